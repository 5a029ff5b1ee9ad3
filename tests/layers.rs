//! The arrows between the rooms of `src/`, read from what their files name.
//!
//! A room is a file or folder directly under `src/`. It may name the rooms and the crates listed
//! for it below and no others; a room that is not listed fails, and so does a listed one that is
//! gone. `partition` may be named by a few files only: kernels know nothing of ranks.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Each room, the rooms it may name, the members of the workspace it may name.
const ROOMS: &[(&str, &[&str], &[&str])] = &[
    ("main", &["case", "report", "simulation"], &["partition"]),
    (
        "simulation",
        &[
            "bodies",
            "case",
            "coupling",
            "cut",
            "fem",
            "flow",
            "linear",
            "mesh",
            "obstacles",
            "phase",
            "report",
            "setup",
        ],
        &["io", "partition"],
    ),
    (
        "coupling",
        &["bodies", "case", "cut", "fem", "flow", "linear", "mesh", "obstacles", "shape"],
        &[],
    ),
    ("obstacles", &["case", "cut", "shape"], &[]),
    (
        "setup",
        &["bodies", "case", "cut", "fem", "flow", "linear", "mesh", "phase", "shape"],
        &["io", "partition"],
    ),
    ("report", &["bodies", "case", "fem", "flow", "mesh", "phase"], &["io", "partition"]),
    ("flow", &["case", "cut", "fem", "linear", "mesh"], &[]),
    ("phase", &["case", "cut", "fem", "linear", "mesh"], &[]),
    ("cut", &["case", "fem", "mesh", "shape"], &[]),
    ("fem", &["case", "mesh"], &[]),
    ("mesh", &["case"], &["partition"]),
    ("linear", &[], &["partition"]),
    ("case", &[], &["io"]),
    ("bodies", &["case", "shape"], &["partition"]),
    ("shape", &[], &[]),
    ("lib", &[], &[]),
];

/// The files that may name `partition`.
const MEET_THE_RANKS: &[&str] = &[
    "bodies/ownership.rs",
    "linear/distributed.rs",
    "main.rs",
    "mesh/part.rs",
    "report/stages.rs",
    "setup.rs",
    "setup/bodies.rs",
    "setup/solids.rs",
    "simulation.rs",
];

/// Each package, and which of the crates that only one of them may use it does use.
const PACKAGES: &[(&str, &[&str])] = &[
    (".", &["io", "partition"]),
    ("io", &["hdf5", "hdf5-sys", "partition"]),
    ("partition", &["metis", "mpi"]),
];

/// The crates that `PACKAGES` is about.
const GUARDED: &[&str] = &["hdf5", "hdf5-sys", "io", "metis", "mpi", "partition"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every source file under `folder`, relative to `src/`.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path.strip_prefix(root().join("src")).unwrap().to_path_buf());
        }
    }
}

/// Words and punctuation of a program, without comments; `::` is one.
fn tokens(text: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    for line in text.lines() {
        let line = line.split("//").next().unwrap_or_default();
        let mut word = String::new();
        for c in line.chars().chain([' ']) {
            if c.is_alphanumeric() || c == '_' {
                word.push(c);
                continue;
            }
            if !word.is_empty() {
                tokens.push(std::mem::take(&mut word));
            }
            match (c, tokens.last_mut()) {
                (':', Some(last)) if last == ":" => last.push(':'),
                (c, _) if c.is_whitespace() => {}
                (c, _) => tokens.push(c.to_string()),
            }
        }
    }
    tokens
}

/// What follows each path of `prefix` (as tokens): one name, or the first names of a braced list.
fn after(tokens: &[String], prefix: &[&str]) -> Vec<String> {
    let mut names = Vec::new();
    for at in 0..tokens.len().saturating_sub(prefix.len()) {
        let starts = at == 0 || tokens[at - 1] != "::";
        if !starts || tokens[at..at + prefix.len()] != *prefix {
            continue;
        }
        let rest = &tokens[at + prefix.len()..];
        if rest[0] != "{" {
            names.push(rest[0].clone());
            continue;
        }
        let mut depth = 0;
        for (token, next) in rest.iter().zip(&rest[1..]) {
            match token.as_str() {
                "{" | "," if depth <= 1 => {
                    depth += usize::from(token == "{");
                    if depth == 1 && next != "}" {
                        names.push(next.clone());
                    }
                }
                "{" => depth += 1,
                "}" => depth -= 1,
                _ => {}
            }
            if depth == 0 {
                break;
            }
        }
    }
    names
}

/// Rooms and workspace members that a file names.
fn named(file: &Path, text: &str) -> BTreeSet<String> {
    let tokens = tokens(text);
    let rooms: Vec<&str> = ROOMS.iter().map(|room| room.0).collect();
    let mut found: BTreeSet<String> = BTreeSet::new();
    for prefix in [&["crate", "::"][..], &["fcm_fsi", "::"]] {
        found.extend(after(&tokens, prefix));
    }
    // `super` far enough up is the root of the crate.
    let depth = file.components().count() - usize::from(file.ends_with("mod.rs"));
    for up in depth..depth + 3 {
        let chain: Vec<&str> = (0..up).flat_map(|_| ["super", "::"]).collect();
        found.extend(after(&tokens, &chain).into_iter().filter(|n| rooms.contains(&&**n)));
    }
    for member in ["io", "partition"] {
        let used = |at: usize| {
            tokens[at] == member
                && (at == 0 || tokens[at - 1] != "::")
                && (tokens.get(at + 1).is_some_and(|t| t == "::")
                    || at > 0 && tokens[at - 1] == "use")
        };
        if (0..tokens.len()).any(used) {
            found.insert(member.into());
        }
    }
    found
}

fn room_of(file: &Path) -> String {
    let first = file.iter().next().unwrap();
    Path::new(first).file_stem().unwrap().to_str().unwrap().into()
}

#[test]
fn rooms_name_only_what_is_below_them() {
    let mut files = Vec::new();
    sources(&root().join("src"), &mut files);
    let mut broken = Vec::new();
    let mut seen: BTreeSet<String> = BTreeSet::new();
    for file in &files {
        let room = room_of(file);
        let shown = file.display();
        let Some((_, rooms, members)) = ROOMS.iter().find(|r| r.0 == room) else {
            broken.push(format!("src/{shown}: the room {room} is not in tests/layers.rs"));
            continue;
        };
        let text = std::fs::read_to_string(root().join("src").join(file)).unwrap();
        for name in named(file, &text) {
            let is_room = ROOMS.iter().any(|r| r.0 == name);
            let is_member = ["io", "partition"].contains(&&*name);
            let allowed = name == room || rooms.contains(&&*name) || members.contains(&&*name);
            if (is_room || is_member) && !allowed {
                broken.push(format!("src/{shown} names {name}"));
            } else if name == "partition" && !MEET_THE_RANKS.iter().any(|f| file.ends_with(f)) {
                broken.push(format!("src/{shown} names partition: it is not to know of ranks"));
            }
        }
        seen.insert(room);
    }
    for (room, ..) in ROOMS {
        if !seen.contains(*room) {
            broken.push(format!("there is no room {room} in src/"));
        }
    }
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn mpi_metis_and_hdf5_stay_in_their_crates() {
    for (package, expected) in PACKAGES {
        let text = std::fs::read_to_string(root().join(package).join("Cargo.toml")).unwrap();
        let manifest: toml::Table = toml::from_str(&text).unwrap();
        let mut used: Vec<&str> = Vec::new();
        for kind in ["dependencies", "dev-dependencies", "build-dependencies"] {
            let names = manifest.get(kind).and_then(|d| d.as_table()).map(|d| d.keys());
            used.extend(names.into_iter().flatten().map(String::as_str));
        }
        used.retain(|name| GUARDED.contains(name));
        used.sort_unstable();
        used.dedup();
        assert_eq!(used, *expected, "what {package}/Cargo.toml depends on");
    }
}

/// The reader of imports itself.
#[test]
fn imports_are_seen_however_they_are_written() {
    let seen = |file: &str, text: &str| -> Vec<String> {
        named(Path::new(file), text).into_iter().collect()
    };
    assert_eq!(seen("phase/mod.rs", "use crate::{fem::{dot, norm}, flow::Flow};"), ["fem", "flow"]);
    assert_eq!(seen("phase/water.rs", "let x = crate::flow::step();"), ["flow"]);
    assert_eq!(seen("phase/water.rs", "use super::super::flow::Flow;"), ["flow"]);
    assert_eq!(seen("phase/mod.rs", "use super::flow::Flow;"), ["flow"]);
    assert!(seen("phase/mod.rs", "// crate::flow\nuse self::water::x;").is_empty());
    assert_eq!(seen("mesh/order.rs", "fn f(c: &partition::Communicator) {}"), ["partition"]);
    assert_eq!(seen("mesh/order.rs", "use partition as p;"), ["partition"]);
    assert!(
        seen("mesh/order.rs", "a.partition_point(); std::io::Error; x.partition(f)").is_empty()
    );
}
