//! Halo exchange: owners' values to ghosts, and ghosts' contributions back to owners.
//!
//! Each pair of neighbours exchanges one message. Ghosts are ordered by owner, so that owners'
//! values arrive where they belong; what leaves is packed.

use crate::message::{Accumulate, Incoming, Item, Outgoing, transfer};
use crate::{Communicator, IndexMap};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// The halo of one index map.
#[derive(Clone, Debug)]
pub struct Exchange {
    n_owned: usize,
    n_local: usize,
    /// Ranks that have ghosts of my owned indices, and where their indices end in `sent`.
    readers: Vec<(usize, usize)>,
    /// Owned indices the readers want, reader by reader.
    sent: Vec<u32>,
    /// Ranks that own my ghosts, and where theirs end (0 is the first ghost).
    owners: Vec<(usize, usize)>,
    traffic: Arc<[AtomicU64; 3]>,
}

/// What left this rank through a halo since it was made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Exchanges, in either direction.
    pub exchanges: u64,
    /// Messages sent.
    pub messages: u64,
    /// Bytes sent.
    pub bytes: u64,
}

impl Exchange {
    /// Collective: finds out who needs which of my owned indices.
    pub fn new(comm: &Communicator, map: &IndexMap) -> Self {
        let owners = owners(comm, map);
        let mut wanted = vec![Vec::new(); comm.size()];
        for (owner, ghosts) in ranges(&owners) {
            wanted[owner] = map.global[map.n_owned..][ghosts].to_vec();
        }
        let asked = comm.exchange_lists(wanted).into_iter().enumerate();
        Self::from_wishes(map, owners, asked)
    }
    /// The halo of a coarser level, whose ghosts belong to ranks that own ghosts of this one: only
    /// neighbours talk to each other. Every rank calls it.
    pub fn coarser(&self, comm: &Communicator, map: &IndexMap) -> Self {
        let owners = owners(comm, map);
        let mut wanted: Vec<(usize, Vec<u64>)> =
            self.owners.iter().map(|owner| (owner.0, Vec::new())).collect();
        for (owner, ghosts) in ranges(&owners) {
            let at = wanted.binary_search_by_key(&owner, |wish| wish.0);
            let at =
                at.unwrap_or_else(|_| panic!("rank {owner} owns no ghosts of the finer level"));
            wanted[at].1 = map.global[map.n_owned..][ghosts].to_vec();
        }
        let readers: Vec<usize> = self.readers().collect();
        let asked = readers.iter().copied().zip(comm.exchange_with(&wanted, &readers));
        Self::from_wishes(map, owners, asked)
    }
    /// From the owners of my ghosts and what each rank wants of my indices, in rank order.
    fn from_wishes(
        map: &IndexMap,
        owners: Vec<(usize, usize)>,
        asked: impl Iterator<Item = (usize, Vec<u64>)>,
    ) -> Self {
        let mut by_global: Vec<(u64, u32)> = Vec::new();
        let (mut readers, mut sent) = (Vec::new(), Vec::new());
        for (reader, list) in asked.filter(|(_, list)| !list.is_empty()) {
            if by_global.is_empty() {
                by_global = (map.global[..map.n_owned].iter().copied()).zip(0..).collect();
                by_global.sort_unstable();
            }
            for global in &list {
                let at =
                    by_global.binary_search_by_key(global, |pair| pair.0).unwrap_or_else(|_| {
                        panic!("rank {reader} takes index {global} for mine, it is not")
                    });
                sent.push(by_global[at].1);
            }
            readers.push((reader, sent.len()));
        }
        let (n_owned, n_local) = (map.n_owned, map.len());
        Self { n_owned, n_local, readers, sent, owners, traffic: Arc::default() }
    }
    /// Ghost values become their owners' values.
    pub fn update_ghosts<T: Item>(&self, x: &mut [T]) {
        self.update_ghosts_during(x, |_| ());
    }
    /// As `update_ghosts`, while `interior` runs on the owned values (ghosts not yet valid).
    pub fn update_ghosts_during<T: Item, R>(
        &self,
        x: &mut [T],
        interior: impl FnOnce(&[T]) -> R,
    ) -> R {
        assert!(x.len() == self.n_local, "{} values, {} local indices", x.len(), self.n_local);
        let (owned, ghosts) = x.split_at_mut(self.n_owned);
        if self.readers.is_empty() && self.owners.is_empty() {
            return interior(owned);
        }
        let packed: Vec<T> = self.sent.iter().map(|&i| owned[i as usize]).collect();
        let mut sends = Vec::with_capacity(self.readers.len());
        for (reader, range) in ranges(&self.readers) {
            sends.extend(Outgoing::messages(&packed[range]).map(|message| (reader, message)));
        }
        let mut receives = Vec::with_capacity(self.owners.len());
        let mut rest = ghosts;
        for (owner, range) in ranges(&self.owners) {
            let (theirs, after) = rest.split_at_mut(range.len());
            rest = after;
            receives.extend(Incoming::messages(theirs).map(|message| (owner, message)));
        }
        self.count(sends.len(), size_of_val(&packed[..]));
        transfer(&sends, &mut receives, || interior(owned))
    }
    /// Ghost contributions are added to their owners' entries (neighbours in rank order, so the sum
    /// is reproducible); ghosts are then stale.
    pub fn sum_to_owners<T: Accumulate>(&self, x: &mut [T]) {
        assert!(x.len() == self.n_local, "{} values, {} local indices", x.len(), self.n_local);
        if self.readers.is_empty() && self.owners.is_empty() {
            return;
        }
        let (owned, ghosts) = x.split_at_mut(self.n_owned);
        let mut sends = Vec::with_capacity(self.owners.len());
        for (owner, range) in ranges(&self.owners) {
            sends.extend(Outgoing::messages(&ghosts[range]).map(|message| (owner, message)));
        }
        let mut arrived: Vec<T> = Vec::with_capacity(self.sent.len());
        let mut receives = Vec::with_capacity(self.readers.len());
        let mut rest = &mut arrived.spare_capacity_mut()[..self.sent.len()];
        for (reader, range) in ranges(&self.readers) {
            let (theirs, after) = rest.split_at_mut(range.len());
            rest = after;
            receives.extend(Incoming::unset(theirs).map(|message| (reader, message)));
        }
        self.count(sends.len(), size_of_val(&ghosts[..]));
        transfer(&sends, &mut receives, || ());
        // SAFETY: `transfer` has set all items from items of this type.
        unsafe { arrived.set_len(self.sent.len()) };
        for (&i, value) in self.sent.iter().zip(arrived) {
            owned[i as usize].accumulate(value);
        }
    }
    /// Ranks that this one sends ghost values to.
    pub fn readers(&self) -> impl Iterator<Item = usize> {
        self.readers.iter().map(|reader| reader.0)
    }
    /// Owned indices that are ghosts elsewhere, with the ranks that see them (a rank at a time).
    pub fn shared(&self) -> impl Iterator<Item = (usize, &[u32])> {
        ranges(&self.readers).map(|(reader, range)| (reader, &self.sent[range]))
    }
    /// What has left this rank so far through this halo and its clones.
    pub fn traffic(&self) -> Traffic {
        let [exchanges, messages, bytes] = [0, 1, 2].map(|i| self.traffic[i].load(Relaxed));
        Traffic { exchanges, messages, bytes }
    }
    fn count(&self, messages: usize, bytes: usize) {
        for (counter, n) in self.traffic.iter().zip([1, messages, bytes]) {
            counter.fetch_add(n as u64, Relaxed);
        }
    }
}

/// Ranks that own the ghosts, and where theirs end.
fn owners(comm: &Communicator, map: &IndexMap) -> Vec<(usize, usize)> {
    let mut owners: Vec<(usize, usize)> = Vec::new();
    for (i, &owner) in map.ghost_owner.iter().enumerate() {
        let owner = owner as usize;
        assert!(owner != comm.rank(), "ghost {i} is of its own owner");
        match owners.last_mut() {
            Some((last, end)) if *last == owner => *end = i + 1,
            Some((last, _)) if *last > owner => panic!("ghosts are not ordered by owner"),
            _ => owners.push((owner, i + 1)),
        }
    }
    owners
}

/// (rank, range of its indices) from (rank, end of its indices).
fn ranges(ends: &[(usize, usize)]) -> impl Iterator<Item = (usize, std::ops::Range<usize>)> {
    let starts = std::iter::once(0).chain(ends.iter().map(|pair| pair.1));
    starts.zip(ends).map(|(start, &(rank, end))| (rank, start..end))
}
