//! "Did you mean": the valid name nearest to a misspelt one.

/// The candidate that takes the fewest slips of the keyboard, if it takes few enough to be meant.
/// Upper and lower case, `-` and `_` are alike.
pub fn nearest<'a>(name: &str, candidates: &[&'a str]) -> Option<&'a str> {
    let plain = |s: &str| s.to_lowercase().replace(['-', ' '], "_");
    let name = plain(name);
    candidates
        .iter()
        .map(|c| (strsim::damerau_levenshtein(&name, &plain(c)), *c))
        .filter(|(slips, c)| *slips <= name.chars().count().max(c.chars().count()) / 3)
        .min_by_key(|(slips, _)| *slips)
        .map(|(_, c)| c)
}

/// `did you mean "…"?`, or the whole list where nothing is near.
pub fn did_you_mean(name: &str, candidates: &[&str], what: &str) -> String {
    match nearest(name, candidates) {
        Some(near) => format!("did you mean \"{near}\"?"),
        None => format!("valid {what}: {}", candidates.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_what_was_meant_and_only_that() {
        let words = ["slip", "no_slip", "open"];
        assert_eq!(nearest("noslip", &words), Some("no_slip"));
        assert_eq!(nearest("No-Slip", &words), Some("no_slip"));
        assert_eq!(nearest("opne", &words), Some("open"));
        assert_eq!(nearest("periodic", &words), None);
        assert_eq!(nearest("densty", &["density", "viscosity"]), Some("density"));
    }
}
