//! Which indices a rank owns, which it only sees, and their names everywhere.

/// Local indices `0..n_owned` are owned, `n_owned..len()` are ghosts, ordered by (owner, global).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IndexMap {
    /// Global id of each local index, owned first.
    pub global: Vec<u64>,
    /// Number of owned indices.
    pub n_owned: usize,
    /// Owner of each ghost.
    pub ghost_owner: Vec<u32>,
}

impl IndexMap {
    /// All indices owned by the one rank.
    pub fn single(n: usize) -> Self {
        Self { global: (0..n as u64).collect(), n_owned: n, ghost_owner: Vec::new() }
    }
    /// Owned and ghost indices together.
    #[allow(clippy::len_without_is_empty)]
    pub fn len(&self) -> usize {
        self.global.len()
    }
}
