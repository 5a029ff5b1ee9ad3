//! Collectives, lists and halos against what one can write down by hand.

use partition::{Communicator, Exchange, IndexMap};

/// Sums, extremes, scans and gathers of rank numbers.
pub fn collectives(comm: &Communicator) {
    let (rank, size) = (comm.rank(), comm.size());
    let n = size as f64;
    let clock = comm.clock();
    comm.sum(1.0);
    comm.max(1.0);
    comm.all_gather(&[1u64]);
    let cost = clock.elapsed();
    let counted = if size > 1 { (4, 40) } else { (0, 0) };
    assert_eq!((cost.collectives, cost.collective_bytes), counted);
    assert!(cost.waiting <= cost.seconds && cost.messages == 0);
    assert_eq!(comm.sum(rank as f64), n * (n - 1.0) / 2.0);
    let mut x = vec![rank as f64, 1.0, -(rank as f64)];
    comm.sum_all(&mut x);
    assert_eq!(x, [n * (n - 1.0) / 2.0, n, -n * (n - 1.0) / 2.0]);
    comm.sum_all(&mut []);
    // The same bits everywhere and every time, although rounding depends on the order.
    let sum = comm.sum(0.1 + (rank as f64).sqrt()).to_bits();
    assert!(comm.all_gather(&[sum]).concat().iter().all(|&bits| bits == sum));
    assert_eq!(comm.sum(0.1 + (rank as f64).sqrt()).to_bits(), sum);
    assert_eq!(comm.sum_u64(1 << 60), (size as u64) << 60);
    assert_eq!(comm.max(-(rank as f64)), 0.0);
    assert_eq!(comm.min(-(rank as f64)), 1.0 - n);
    assert!(comm.max(if rank == size - 1 { f64::NAN } else { 1e300 }).is_nan());
    assert!(comm.min(if rank == 0 { f64::NAN } else { -1e300 }).is_nan());
    assert!(comm.any(rank == size - 1) && !comm.any(false));
    assert_eq!(comm.exclusive_sum(rank as u64 + 1), (rank * (rank + 1) / 2) as u64);

    // Rank r gives r bytes: the first rank's list is empty.
    let mine = vec![rank as u8; rank];
    let all = comm.all_gather(&mine);
    assert!(all.len() == size && (0..size).all(|r| all[r] == vec![r as u8; r]));
    assert!(comm.all_gather::<u8>(&[]).iter().all(Vec::is_empty));
    let root = size - 1;
    let told = comm.broadcast(root, if rank == root { vec![(7u32, 0.5f64); 3] } else { vec![] });
    assert_eq!(told, [(7, 0.5); 3]);
    assert!(comm.broadcast::<u8>(root, vec![]).is_empty());
}

/// Typed all-to-all with empty lists, and lists to oneself.
pub fn lists_between_ranks(comm: &Communicator) {
    let (rank, size) = (comm.rank(), comm.size());
    let list = |from: usize, to: usize| vec![[from as f64, to as f64]; (from * 3 + to) % 4];
    let outgoing = (0..size).map(|to| list(rank, to)).collect();
    for (from, arrived) in comm.exchange_lists(outgoing).into_iter().enumerate() {
        assert_eq!(arrived, list(from, rank));
    }
    let nothing: Vec<Vec<u8>> = comm.exchange_lists(vec![vec![]; size]);
    assert!(nothing.iter().all(Vec::is_empty));
}

/// The lowest failing rank's message is every rank's.
pub fn agreement_on_errors(comm: &Communicator) {
    assert_eq!(comm.agree(Ok::<_, String>(comm.rank())), Ok(comm.rank()));
    let failing = comm.size() / 2;
    let mine = if comm.rank() < failing {
        Ok(1.0)
    } else {
        Err(format!("rank {} cannot read μ", comm.rank()))
    };
    assert_eq!(comm.agree(mine), Err(format!("rank {failing} cannot read μ")));
    let none = if comm.rank() == comm.size() - 1 { Err("") } else { Ok(()) };
    assert_eq!(comm.agree(none), Err(String::new()));
}

/// Each rank owns a run of a ring's nodes and sees the whole rest of the ring.
pub fn halo_of_a_ring(comm: &Communicator) {
    const EACH: u64 = 5;
    let (rank, n) = (comm.rank() as u64, comm.size() as u64 * EACH);
    // Owned indices in descending order: local order need not be global order.
    let mut global: Vec<u64> = (rank * EACH..(rank + 1) * EACH).rev().collect();
    let ghosts: Vec<u64> = (0..n).filter(|g| g / EACH != rank).collect();
    let ghost_owner = ghosts.iter().map(|g| (g / EACH) as u32).collect();
    global.extend(ghosts);
    let map = IndexMap { global: global.clone(), n_owned: EACH as usize, ghost_owner };
    let halo = Exchange::new(comm, &map);

    let clock = comm.clock();
    let value = |g: u64| [g as f64, -1.5 * g as f64, 1.0, 0.0];
    let mut x: Vec<[f64; 4]> = global.iter().map(|&g| value(g)).collect();
    x[map.n_owned..].fill([f64::NAN; 4]);
    let seen = halo.update_ghosts_during(&mut x, |owned| owned.len());
    assert_eq!(seen, map.n_owned);
    assert!(x.iter().zip(&global).all(|(x, &g)| *x == value(g)));
    let mut id: Vec<u8> = global.iter().map(|&g| g as u8).collect();
    id[map.n_owned..].fill(255);
    halo.update_ghosts(&mut id);
    assert!(id.iter().zip(&global).all(|(&x, &g)| x == g as u8));

    // Every rank adds its number + 1 to every node.
    let mut sum = vec![rank + 1; map.len()];
    halo.sum_to_owners(&mut sum);
    let all = comm.size() as u64;
    assert!(sum[..map.n_owned].iter().all(|&s| s == all * (all + 1) / 2));

    let messages = if all > 1 { 3 * (all - 1) } else { 0 };
    assert_eq!(halo.traffic().messages, messages);
    let bytes = (all - 1) * EACH * (32 + 1 + 8);
    assert_eq!(halo.traffic().bytes, bytes);
    let cost = clock.elapsed();
    assert_eq!((cost.messages, cost.bytes, cost.collectives), (messages, bytes, 0));

    // A coarser ring of every rank's first node, seen by the next rank.
    let (me, before) = (comm.rank(), (comm.rank() + comm.size() - 1) % comm.size());
    let mut global = vec![me as u64];
    let mut ghost_owner = Vec::new();
    if before != me {
        global.push(before as u64);
        ghost_owner.push(before as u32);
    }
    let coarse = halo.coarser(comm, &IndexMap { global, n_owned: 1, ghost_owner });
    let mut x = vec![me as u32, u32::MAX];
    x.truncate(if before == me { 1 } else { 2 });
    coarse.update_ghosts(&mut x);
    assert_eq!(x[x.len() - 1], before as u32);
}
