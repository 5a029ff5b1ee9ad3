//! A group of ranks and the few collectives the program needs.

use crate::cost::{Clock, collective};
use crate::message::{Incoming, Item, Outgoing, transfer};
use mpi::collective::SystemOperation;
use mpi::datatype::PartitionMut;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{AsRaw, Communicator as _, CommunicatorCollectives as _, Root as _};

/// The handle that C libraries (MPI-IO) take.
pub type RawCommunicator = mpi::ffi::MPI_Comm;

/// A group of ranks. Cheap to clone. `single()` needs no MPI.
///
/// Methods are collective (every rank calls them, in the same order) but for `rank`, `size`,
/// `raw_mpi`, `clock`, `exchange_with`, `send_list` and `receive_list`.
#[derive(Clone, Debug)]
pub struct Communicator {
    rank: usize,
    size: usize,
    mpi: bool,
}

impl Communicator {
    /// One rank, without MPI (unit tests).
    pub fn single() -> Self {
        Self { rank: 0, size: 1, mpi: false }
    }
    /// All ranks of the program; MPI must be running (`start`).
    pub(crate) fn world() -> Self {
        let world = SimpleCommunicator::world();
        Self { rank: world.rank() as usize, size: world.size() as usize, mpi: true }
    }
    /// This rank, `0..size`.
    pub fn rank(&self) -> usize {
        self.rank
    }
    /// Number of ranks.
    pub fn size(&self) -> usize {
        self.size
    }
    /// The C handle, `None` without MPI.
    pub fn raw_mpi(&self) -> Option<RawCommunicator> {
        self.mpi.then(|| SimpleCommunicator::world().as_raw())
    }
    /// Starts to measure what this rank spends, on its own and on talking to others. Not collective.
    pub fn clock(&self) -> Clock {
        Clock::start()
    }
    /// Sum over ranks, the same bits on every rank.
    pub fn sum(&self, x: f64) -> f64 {
        let mut sum = x;
        if self.size > 1 {
            collective(8, || {
                SimpleCommunicator::world().all_reduce_into(&x, &mut sum, SystemOperation::sum());
            });
        }
        sum
    }
    /// Element-wise sum over ranks, in place. The same length on all ranks.
    pub fn sum_all(&self, x: &mut [f64]) {
        if self.size > 1 && !x.is_empty() {
            let mine = x.to_vec();
            collective(size_of_val(x), || {
                SimpleCommunicator::world().all_reduce_into(&mine[..], x, SystemOperation::sum());
            });
        }
    }
    /// Sum of counts over ranks.
    pub fn sum_u64(&self, x: u64) -> u64 {
        let mut sum = x;
        if self.size > 1 {
            collective(8, || {
                SimpleCommunicator::world().all_reduce_into(&x, &mut sum, SystemOperation::sum());
            });
        }
        sum
    }
    /// Largest over ranks (NaN wins: a NaN on one rank is a NaN on all).
    pub fn max(&self, x: f64) -> f64 {
        if self.size == 1 {
            return x;
        }
        let mine = if x.is_nan() { [f64::NEG_INFINITY, 1.0] } else { [x, 0.0] };
        let mut all = [0.0; 2];
        collective(16, || {
            SimpleCommunicator::world().all_reduce_into(&mine, &mut all, SystemOperation::max());
        });
        if all[1] > 0.0 { f64::NAN } else { all[0] }
    }
    /// Smallest over ranks (NaN wins).
    pub fn min(&self, x: f64) -> f64 {
        -self.max(-x)
    }
    /// True on all ranks if true on any.
    pub fn any(&self, x: bool) -> bool {
        self.sum_u64(x as u64) > 0
    }
    /// Sum of `x` over the ranks before this one.
    pub fn exclusive_sum(&self, x: u64) -> u64 {
        let mut before = 0;
        if self.size > 1 {
            let world = SimpleCommunicator::world();
            collective(8, || {
                world.exclusive_scan_into(&x, &mut before, SystemOperation::sum());
            });
        }
        // MPI leaves the first rank's result undefined.
        if self.rank == 0 { 0 } else { before }
    }
    /// Every rank's list, on every rank, in rank order. For short lists (together below 2 GB).
    pub fn all_gather<T: Item>(&self, mine: &[T]) -> Vec<Vec<T>> {
        if self.size == 1 {
            return vec![mine.to_vec()];
        }
        let world = SimpleCommunicator::world();
        let mut n = vec![0u64; self.size];
        collective(8, || world.all_gather_into(&(mine.len() as u64), &mut n[..]));
        let total = n.iter().sum::<u64>() as usize;
        let mut joined = Vec::with_capacity(total);
        let bytes: Vec<i32> = n.iter().map(|&n| (n as usize * size_of::<T>()) as i32).collect();
        let whole = i32::try_from(total * size_of::<T>());
        if whole.unwrap_or_else(|_| panic!("{total} items are too many to gather on all ranks")) > 0
        {
            let starts: Vec<i32> = bytes
                .iter()
                .scan(0, |end, n| {
                    *end += n;
                    Some(*end - n)
                })
                .collect();
            let mut room = Incoming::whole(&mut joined.spare_capacity_mut()[..total]);
            let mut parts = PartitionMut::new(&mut room, bytes, starts);
            collective(size_of_val(mine), || {
                world.all_gather_varcount_into(&Outgoing::whole(mine), &mut parts);
            });
        }
        // SAFETY: MPI has set all items from items of this type.
        unsafe { joined.set_len(total) };
        let mut rest = &joined[..];
        n.iter()
            .map(|&n| rest.split_off(..n as usize).expect("counts sum to total").to_vec())
            .collect()
    }
    /// Sends `outgoing[r]` to rank `r`; returns what each rank sent here, in rank order.
    pub fn exchange_lists<T: Item>(&self, mut outgoing: Vec<Vec<T>>) -> Vec<Vec<T>> {
        assert!(outgoing.len() == self.size, "{} lists, {} ranks", outgoing.len(), self.size);
        if self.size == 1 {
            return outgoing;
        }
        let counts: Vec<u64> = outgoing.iter().map(|list| list.len() as u64).collect();
        let mut coming = vec![0u64; self.size];
        collective(size_of_val(&counts[..]), || {
            SimpleCommunicator::world().all_to_all_into(&counts[..], &mut coming[..]);
        });
        let mine = std::mem::take(&mut outgoing[self.rank]);
        coming[self.rank] = 0;

        let mut arrived: Vec<Vec<T>> =
            coming.iter().map(|&n| Vec::with_capacity(n as usize)).collect();
        let mut receives = Vec::new();
        for (from, list) in arrived.iter_mut().enumerate() {
            let room = &mut list.spare_capacity_mut()[..coming[from] as usize];
            receives.extend(Incoming::unset(room).map(|message| (from, message)));
        }
        let mut sends = Vec::new();
        for (to, list) in outgoing.iter().enumerate() {
            sends.extend(Outgoing::messages(list).map(|message| (to, message)));
        }
        transfer(&sends, &mut receives, || ());
        for (list, n) in arrived.iter_mut().zip(coming) {
            // SAFETY: `transfer` has set the first n items from items of this type.
            unsafe { list.set_len(n as usize) };
        }
        arrived[self.rank] = mine;
        arrived
    }
    /// Sends each of these ranks its list; returns the lists that the ranks `from` send here, in their order. All
    /// of these call it; other ranks need not.
    pub fn exchange_with<T: Item>(
        &self,
        outgoing: &[(usize, Vec<T>)],
        from: &[usize],
    ) -> Vec<Vec<T>> {
        let leaving: Vec<[u64; 1]> = outgoing.iter().map(|(_, list)| [list.len() as u64]).collect();
        let mut coming = vec![[0u64; 1]; from.len()];
        let mut sends = Vec::with_capacity(outgoing.len());
        for ((to, _), n) in outgoing.iter().zip(&leaving) {
            sends.extend(Outgoing::messages(n).map(|message| (*to, message)));
        }
        let mut receives = Vec::with_capacity(from.len());
        for (from, n) in from.iter().zip(&mut coming) {
            receives.extend(Incoming::messages(n).map(|message| (*from, message)));
        }
        transfer(&sends, &mut receives, || ());
        drop((sends, receives));

        let mut arrived: Vec<Vec<T>> =
            coming.iter().map(|&[n]| Vec::with_capacity(n as usize)).collect();
        let mut receives = Vec::with_capacity(from.len());
        for ((from, list), [n]) in from.iter().zip(&mut arrived).zip(&coming) {
            let room = &mut list.spare_capacity_mut()[..*n as usize];
            receives.extend(Incoming::unset(room).map(|message| (*from, message)));
        }
        let mut sends = Vec::with_capacity(outgoing.len());
        for (to, list) in outgoing {
            sends.extend(Outgoing::messages(list).map(|message| (*to, message)));
        }
        transfer(&sends, &mut receives, || ());
        for (list, [n]) in arrived.iter_mut().zip(coming) {
            // SAFETY: `transfer` has set the first n items from items of this type.
            unsafe { list.set_len(n as usize) };
        }
        arrived
    }
    /// Sends a list to another rank, which receives it with `receive_list`. Concerns the two alone.
    pub fn send_list<T: Item>(&self, to: usize, list: &[T]) {
        let n = [list.len() as u64];
        let messages = Outgoing::messages(&n).chain(Outgoing::messages(list));
        transfer(&messages.map(|message| (to, message)).collect::<Vec<_>>(), &mut [], || ());
    }
    /// The list that rank `from` sends with `send_list`.
    pub fn receive_list<T: Item>(&self, from: usize) -> Vec<T> {
        let mut n = [0u64];
        let messages = Incoming::messages(&mut n).map(|message| (from, message));
        transfer(&[], &mut messages.collect::<Vec<_>>(), || ());
        let n = n[0] as usize;
        let mut list = Vec::with_capacity(n);
        let messages = Incoming::unset(&mut list.spare_capacity_mut()[..n]);
        transfer(&[], &mut messages.map(|message| (from, message)).collect::<Vec<_>>(), || ());
        // SAFETY: `transfer` has set all items from items of this type.
        unsafe { list.set_len(n) };
        list
    }
    /// `root`'s list on every rank (what the others pass is dropped).
    pub fn broadcast<T: Item>(&self, root: usize, mut mine: Vec<T>) -> Vec<T> {
        if self.size == 1 {
            return mine;
        }
        let world = SimpleCommunicator::world();
        let sender = world.process_at_rank(root as i32);
        let mut n = mine.len() as u64;
        collective(8, || sender.broadcast_into(&mut n));
        let n = n as usize;
        if self.rank != root {
            mine = Vec::with_capacity(n);
            for mut message in Incoming::unset(&mut mine.spare_capacity_mut()[..n]) {
                collective(0, || sender.broadcast_into(&mut message));
            }
            // SAFETY: the root has set all items from items of this type.
            unsafe { mine.set_len(n) };
        } else {
            for mut message in Incoming::messages(&mut mine) {
                collective(message.bytes(), || sender.broadcast_into(&mut message));
            }
        }
        mine
    }
    /// `Ok` only if every rank is `Ok`; otherwise every rank gets the lowest failing rank's message.
    pub fn agree<T, E: std::fmt::Display>(&self, mine: Result<T, E>) -> Result<T, String> {
        let mine = mine.map_err(|e| e.to_string());
        if self.size == 1 {
            return mine;
        }
        let failed = if mine.is_err() { self.rank } else { self.size };
        let mut lowest = failed as u64;
        collective(8, || {
            SimpleCommunicator::world().all_reduce_into(
                &(failed as u64),
                &mut lowest,
                SystemOperation::min(),
            );
        });
        if lowest == self.size as u64 {
            return mine;
        }
        let message = mine.err().unwrap_or_default().into_bytes();
        let message = self.broadcast(lowest as usize, message);
        Err(String::from_utf8(message).expect("a message is text"))
    }
}
