//! TOML to typed values, with the line and key of whatever does not fit.
//!
//! `toml` parses to a tree that knows where everything stands; `serde` fills the types from it here,
//! so that every refusal carries its key, its place and the nearest valid name.

use super::nearest::did_you_mean;
use serde::de::{self, DeserializeSeed, Expected, IntoDeserializer, Unexpected, Visitor};
use std::fmt;
use std::ops::Range;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// A parsed TOML text.
pub struct Tree<'a> {
    text: &'a str,
    root: Spanned<DeTable<'a>>,
}

/// What does not fit, and where.
#[derive(Clone, Debug, PartialEq)]
pub struct Misfit {
    /// Dotted key, once known.
    pub key: Option<String>,
    /// Line, from 1, once known.
    pub line: Option<usize>,
    /// What is wrong and what would be right.
    pub message: String,
}

impl<'a> Tree<'a> {
    /// Parses a text.
    pub fn parse(text: &'a str) -> Result<Self, Misfit> {
        let root = DeTable::parse(text).map_err(|error| {
            let span = error.span();
            let line = span.as_ref().map(|s| line(text, s.start));
            if error.message() == "duplicate key" {
                let key = span.map(|s| text[s].to_string());
                return Misfit { key, line, message: "given twice".into() };
            }
            Misfit { key: None, line, message: format!("not valid TOML: {}", error.message()) }
        })?;
        Ok(Self { text, root })
    }

    /// The typed values.
    pub fn read<T: de::DeserializeOwned>(&self) -> Result<T, Misfit> {
        let table = self.root.get_ref();
        let place = Place { text: self.text, path: Path::Root, at: None };
        T::deserialize(Node { place, value: Value::Table(table) })
    }

    /// Line of a dotted key, or of the nearest table around it that is written in the file.
    pub fn line_of(&self, key: &str) -> Option<usize> {
        let mut table = self.root.get_ref();
        let mut found = None;
        for segment in key.split('.') {
            let (name, index) = match segment.split_once('[') {
                Some((name, index)) => (name, index.trim_end_matches(']').parse::<usize>().ok()),
                None => (segment, None),
            };
            let Some((spanned, value)) = table.get_key_value(name) else { break };
            found = Some(spanned.span().start);
            let mut value = value.get_ref();
            if let (Some(index), Some(list)) = (index, value.as_array()) {
                let Some(item) = index.checked_sub(1).and_then(|i| list.get(i)) else { break };
                found = Some(item.span().start);
                value = item.get_ref();
            }
            match value.as_table() {
                Some(inner) => table = inner,
                None => break,
            }
        }
        found.map(|at| line(self.text, at))
    }
}

fn line(text: &str, at: usize) -> usize {
    text[..at.min(text.len())].matches('\n').count() + 1
}

/// From the root to a value.
#[derive(Clone, Copy)]
enum Path<'p> {
    Root,
    Key(&'p Path<'p>, &'p str),
    Item(&'p Path<'p>, usize),
}

impl fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Path::Root => Ok(()),
            Path::Key(Path::Root, key) => write!(f, "{key}"),
            Path::Key(parent, key) => write!(f, "{parent}.{key}"),
            Path::Item(parent, index) => write!(f, "{parent}[{}]", index + 1),
        }
    }
}

#[derive(Clone, Copy)]
struct Place<'p> {
    text: &'p str,
    path: Path<'p>,
    at: Option<usize>,
}

impl Place<'_> {
    /// The innermost place a misfit passes on its way out is where it is.
    fn of(&self, mut misfit: Misfit) -> Misfit {
        if misfit.key.is_none() {
            misfit.key = Some(self.path.to_string());
            misfit.line = self.at.map(|at| line(self.text, at));
        }
        misfit
    }
}

#[derive(Clone, Copy)]
enum Value<'p> {
    Table(&'p DeTable<'p>),
    Other(&'p DeValue<'p>),
}

/// A value at its place.
#[derive(Clone, Copy)]
struct Node<'p> {
    place: Place<'p>,
    value: Value<'p>,
}

impl<'p> Node<'p> {
    fn new(text: &'p str, path: Path<'p>, span: Range<usize>, value: &'p DeValue<'p>) -> Self {
        let value = match value {
            DeValue::Table(table) => Value::Table(table),
            other => Value::Other(other),
        };
        Self { place: Place { text, path, at: Some(span.start) }, value }
    }

    fn unexpected(&self) -> Unexpected<'p> {
        match self.value {
            Value::Table(_) => Unexpected::Map,
            Value::Other(DeValue::String(s)) => Unexpected::Str(s),
            Value::Other(DeValue::Array(_)) => Unexpected::Seq,
            Value::Other(DeValue::Boolean(b)) => Unexpected::Bool(*b),
            Value::Other(_) => Unexpected::Other("this"),
        }
    }
}

impl<'de> de::Deserializer<'de> for Node<'_> {
    type Error = Misfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        let result = match self.value {
            Value::Table(table) => {
                // In the file's order, so that the first mistake is the one reported.
                let mut entries: Vec<_> = table.iter().collect();
                entries.sort_by_key(|(key, _)| key.span().start);
                visitor.visit_map(Entries { place: self.place, entries, next: 0 })
            }
            Value::Other(DeValue::String(s)) => visitor.visit_str(s),
            Value::Other(DeValue::Boolean(b)) => visitor.visit_bool(*b),
            Value::Other(DeValue::Integer(i)) => match i64::from_str_radix(i.as_str(), i.radix()) {
                Ok(i) => visitor.visit_i64(i),
                Err(_) => Err(de::Error::custom(format!("{i} is too large"))),
            },
            Value::Other(DeValue::Float(f)) => match f.as_str().parse() {
                Ok(f) => visitor.visit_f64(f),
                Err(_) => Err(de::Error::custom(format!("{f} is no number"))),
            },
            Value::Other(DeValue::Array(list)) => {
                visitor.visit_seq(Items { place: self.place, list: list.iter(), next: 0 })
            }
            Value::Other(DeValue::Datetime(_)) => {
                Err(de::Error::invalid_type(Unexpected::Other("a date"), &visitor))
            }
            Value::Other(DeValue::Table(_)) => unreachable!("tables are unwrapped in Node::new"),
        };
        result.map_err(|m| self.place.of(m))
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _name: &'static str,
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_tuple<V: Visitor<'de>>(
        self,
        length: usize,
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        if let Value::Other(DeValue::Array(list)) = self.value
            && list.len() != length
        {
            return Err(self.place.of(de::Error::invalid_length(list.len(), &visitor)));
        }
        self.deserialize_any(visitor)
    }

    /// Words only: no variant carries data.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _name: &'static str,
        words: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        match self.value {
            Value::Other(DeValue::String(word)) => {
                let word: &str = word;
                visitor.visit_enum(IntoDeserializer::<Misfit>::into_deserializer(word))
            }
            _ => Err(de::Error::invalid_type(self.unexpected(), &OneOf(words))),
        }
        .map_err(|m| self.place.of(m))
    }

    serde::forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct seq tuple_struct map struct identifier ignored_any
    }
}

struct OneOf(&'static [&'static str]);

impl Expected for OneOf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let words: Vec<String> = self.0.iter().map(|w| format!("\"{w}\"")).collect();
        write!(f, "{}", words.join(" or "))
    }
}

struct Entries<'p> {
    place: Place<'p>,
    entries: Vec<(&'p Spanned<DeString<'p>>, &'p Spanned<DeValue<'p>>)>,
    next: usize,
}

impl<'de> de::MapAccess<'de> for Entries<'_> {
    type Error = Misfit;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Misfit> {
        let Some((key, _)) = self.entries.get(self.next) else { return Ok(None) };
        let name: &str = key.get_ref();
        let path = Path::Key(&self.place.path, name);
        let place = Place { path, at: Some(key.span().start), ..self.place };
        seed.deserialize(IntoDeserializer::<Misfit>::into_deserializer(name))
            .map(Some)
            .map_err(|m| place.of(m))
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Misfit> {
        let (key, value) = self.entries[self.next];
        self.next += 1;
        let path = Path::Key(&self.place.path, key.get_ref());
        seed.deserialize(Node::new(self.place.text, path, value.span(), value.get_ref()))
    }
}

struct Items<'p> {
    place: Place<'p>,
    list: std::slice::Iter<'p, Spanned<DeValue<'p>>>,
    next: usize,
}

impl<'de> de::SeqAccess<'de> for Items<'_> {
    type Error = Misfit;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Misfit> {
        let Some(item) = self.list.next() else { return Ok(None) };
        let path = Path::Item(&self.place.path, self.next);
        self.next += 1;
        seed.deserialize(Node::new(self.place.text, path, item.span(), item.get_ref())).map(Some)
    }
}

impl fmt::Display for Misfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.message)
    }
}

impl std::error::Error for Misfit {}

impl de::Error for Misfit {
    fn custom<T: fmt::Display>(message: T) -> Self {
        Self { key: None, line: None, message: message.to_string() }
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        de::Error::custom(format!("{} expected, found {}", wanted(expected), described(found)))
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(length: usize, expected: &dyn Expected) -> Self {
        let s = if length == 1 { "" } else { "s" };
        de::Error::custom(format!("{} expected, found {length} value{s}", wanted(expected)))
    }

    fn unknown_variant(word: &str, words: &'static [&'static str]) -> Self {
        de::Error::custom(format!(
            "unknown word \"{word}\"; {}",
            did_you_mean(word, words, "words")
        ))
    }

    fn unknown_field(key: &str, keys: &'static [&'static str]) -> Self {
        de::Error::custom(format!("unknown key; {}", did_you_mean(key, keys, "keys")))
    }

    fn missing_field(key: &'static str) -> Self {
        de::Error::custom(format!("the key \"{key}\" is missing"))
    }
}

/// Serde's names of Rust types, for people.
fn wanted(expected: &dyn Expected) -> String {
    let name = expected.to_string();
    match name.as_str() {
        "f64" => "a number".into(),
        "u32" | "u64" => "a whole number, 0 or more,".into(),
        "a string" => "text".into(),
        "a boolean" => "true or false".into(),
        "a sequence" => "a list".into(),
        _ if name.starts_with("struct ") => "a table".into(),
        _ => match name.strip_prefix("an array of length ") {
            Some(n) => format!("a list of {n} values"),
            None => name,
        },
    }
}

fn described(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Str(text) => format!("\"{text}\""),
        Unexpected::Bool(b) => b.to_string(),
        Unexpected::Signed(i) => i.to_string(),
        Unexpected::Unsigned(i) => i.to_string(),
        Unexpected::Float(f) => f.to_string(),
        Unexpected::Seq => "a list".into(),
        Unexpected::Map => "a table".into(),
        other => other.to_string(),
    }
}
