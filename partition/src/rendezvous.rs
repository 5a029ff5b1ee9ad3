//! What several ranks know of one thing is told to the thing's home rank, which answers all of them.
//!
//! Things are named by 64-bit ids below `bound`; their homes are equal runs of ids, so that no rank
//! needs a list of all things, and answers do not depend on hashing.

use crate::{Communicator, Item};

/// The rank where `id` of `0..bound` is known.
fn home(id: u64, bound: u64, size: usize) -> usize {
    assert!(id < bound, "id {id} is not below {bound}");
    (u128::from(id) * size as u128 / u128::from(bound)) as usize
}

/// Sends each question (home, question) and returns its answer, in the order of the questions.
/// `answer` takes each rank's questions and returns as many answers for each.
fn ask<Q: Item, A: Item>(
    comm: &Communicator,
    questions: impl Iterator<Item = (usize, Q)>,
    answer: impl FnOnce(&[Vec<Q>]) -> Vec<Vec<A>>,
) -> Vec<A> {
    let mut outgoing = vec![Vec::new(); comm.size()];
    let mut homes = Vec::new();
    for (home, question) in questions {
        outgoing[home].push(question);
        homes.push(home as u32);
    }
    let answers = comm.exchange_lists(answer(&comm.exchange_lists(outgoing)));
    let mut next = vec![0; comm.size()];
    homes
        .into_iter()
        .map(|home| {
            let at = &mut next[home as usize];
            *at += 1;
            answers[home as usize][*at - 1]
        })
        .collect()
}

/// Who owns a shared thing.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Owner {
    /// The owning rank.
    pub rank: u32,
    /// Whether any other rank named it.
    pub shared: bool,
}
crate::item!(Owner { rank, shared });

/// Collective. The owner of each id: the rank that gives it the largest weight; among equals the
/// one that the id picks. A rank names an id once.
pub fn owners(comm: &Communicator, ids: &[u64], weights: &[u32], bound: u64) -> Vec<Owner> {
    let questions =
        ids.iter().zip(weights).map(|(&id, &w)| (home(id, bound, comm.size()), (id, w)));
    ask(comm, questions, |asked: &[Vec<(u64, u32)>]| {
        let mut claims: Vec<(u64, u32, u32)> = Vec::new();
        for (rank, list) in (0..).zip(asked) {
            claims.extend(list.iter().map(|&(id, weight)| (id, rank, weight)));
        }
        claims.sort_unstable();
        let owners: Vec<(u64, Owner)> = claims
            .chunk_by(|a, b| a.0 == b.0)
            .map(|claims| {
                let most = claims.iter().map(|claim| claim.2).max().unwrap_or(0);
                let equal = || claims.iter().filter(|claim| claim.2 == most);
                let pick = scramble(claims[0].0) % equal().count() as u64;
                let rank = equal().nth(pick as usize).map_or(0, |claim| claim.1);
                (claims[0].0, Owner { rank, shared: claims.len() > 1 })
            })
            .collect();
        let find = |id: u64| {
            owners[owners.binary_search_by_key(&id, |owner| owner.0).expect("every id is claimed")]
                .1
        };
        asked.iter().map(|list| list.iter().map(|&(id, _)| find(id)).collect()).collect()
    })
}

/// A fixed mixing of bits (the finaliser of SplitMix64), so that ids in a row pick differently.
fn scramble(id: u64) -> u64 {
    let x = (id ^ (id >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

/// Collective. Numbers the distinct keys of all ranks in ascending order: the number of each of
/// `keys`, and how many there are. The numbers do not depend on the ranks. `bound` is above every
/// first entry.
pub fn number(comm: &Communicator, keys: &[[u64; 2]], bound: u64) -> (Vec<u64>, u64) {
    let questions = keys.iter().map(|&key| (home(key[0], bound, comm.size()), key));
    let mut total = 0;
    let numbers = ask(comm, questions, |asked: &[Vec<[u64; 2]>]| {
        let mut distinct = asked.concat();
        distinct.sort_unstable();
        distinct.dedup();
        let before = comm.exclusive_sum(distinct.len() as u64);
        total = comm.sum_u64(distinct.len() as u64);
        let find = |key| before + distinct.binary_search(key).expect("every key is listed") as u64;
        asked.iter().map(|list| list.iter().map(find).collect()).collect()
    });
    (numbers, total)
}

/// Collective. For each key the other rank that has it, with its index there; `None` unless exactly
/// two ranks have it. A rank lists a key once. `bound` is above every first entry.
pub fn partners(comm: &Communicator, keys: &[[u64; 3]], bound: u64) -> Vec<Option<(u32, u32)>> {
    let questions = keys.iter().map(|&key| (home(key[0], bound, comm.size()), key));
    let questions = (0u32..).zip(questions).map(|(index, (home, key))| (home, (key, index)));
    ask(comm, questions, |asked: &[Vec<([u64; 3], u32)>]| {
        let mut all: Vec<([u64; 3], u32, u32)> = Vec::new();
        for (rank, list) in (0..).zip(asked) {
            all.extend(list.iter().map(|&(key, index)| (key, rank, index)));
        }
        all.sort_unstable();
        let find = |rank: u32, key: &[u64; 3]| {
            let first = all.partition_point(|entry| entry.0 < *key);
            let same = all[first..].iter().take_while(|entry| entry.0 == *key);
            let (mut other, mut n) = (None, 0);
            for &(_, holder, index) in same {
                n += 1;
                if holder != rank {
                    other = Some((holder, index));
                }
            }
            if n == 2 { other } else { None }
        };
        (0..)
            .zip(asked)
            .map(|(rank, list)| list.iter().map(|(key, _)| find(rank, key)).collect())
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn homes_are_equal_runs() {
        let mut count = [0; 3];
        for id in 0..30 {
            count[home(id, 30, 3)] += 1;
        }
        assert_eq!(count, [10; 3]);
        assert_eq!(home(u64::MAX - 1, u64::MAX, 7), 6);
    }

    #[test]
    fn one_rank_owns_and_numbers_all() {
        let comm = Communicator::single();
        let owners = owners(&comm, &[5, 2], &[1, 9], 6);
        assert_eq!(owners, [Owner { rank: 0, shared: false }; 2]);
        let keys = [[3, 4], [0, 9], [3, 4], [1, 2]];
        assert_eq!(number(&comm, &keys, 4), (vec![2, 0, 2, 1], 3));
        assert_eq!(partners(&comm, &[[0, 1, 2]], 1), [None]);
    }
}
