//! Where linear algebra meets the ranks: halo, operator, inner product, gathered levels.
//!
//! The only file of this room that names `partition`. Everything else is written as for one rank.

use super::block_csr::{BlockCsr, Rows, Value};
use super::krylov::PIECE;
use super::operator::{InnerProduct, Operator};
use super::pattern::{ElementPlaces, FAR, Pattern};
pub use partition::Item;
use partition::{Communicator, Exchange, IndexMap};
use std::ops::Range;
use std::sync::Arc;

/// Index of a node that is in no aggregate.
pub const NONE: u32 = u32::MAX;

/// How the rows of one node graph meet the ranks.
#[derive(Clone, Debug)]
pub struct Halo {
    comm: Communicator,
    exchange: Exchange,
    nodes: Arc<IndexMap>,
    /// Runs of rows without ghost columns.
    interior: Vec<Range<u32>>,
    /// The other rows.
    border: Vec<Range<u32>>,
}

impl Halo {
    /// Of matrices with this pattern, whose rows are the owned indices of `nodes`.
    pub fn new(
        comm: &Communicator,
        nodes: &IndexMap,
        exchange: &Exchange,
        pattern: &Pattern,
    ) -> Self {
        assert_eq!(pattern.n_rows(), nodes.n_owned, "rows are owned nodes");
        let (mut interior, mut border) = (Vec::<Range<u32>>::new(), Vec::<Range<u32>>::new());
        for i in 0..nodes.n_owned as u32 {
            let inner =
                pattern.columns_of(i as usize).iter().all(|&j| (j as usize) < nodes.n_owned);
            let runs = if inner { &mut interior } else { &mut border };
            match runs.last_mut() {
                Some(run) if run.end == i => run.end += 1,
                _ => runs.push(i..i + 1),
            }
        }
        Self {
            comm: comm.clone(),
            exchange: exchange.clone(),
            nodes: Arc::new(nodes.clone()),
            interior,
            border,
        }
    }

    /// Nodes this rank owns.
    pub fn n_owned(&self) -> usize {
        self.nodes.n_owned
    }

    /// Owned and ghost nodes.
    pub fn n_local(&self) -> usize {
        self.nodes.len()
    }

    /// All rows on one rank, or the same on each.
    pub fn single(n: usize) -> Self {
        let (comm, nodes) = (Communicator::single(), IndexMap::single(n));
        let exchange = Exchange::new(&comm, &nodes);
        let all = 0..n as u32;
        Self {
            comm,
            exchange,
            nodes: Arc::new(nodes),
            interior: Vec::from([all]),
            border: Vec::new(),
        }
    }

    /// What has left this rank through the halo: exchanges, messages, bytes.
    pub fn traffic(&self) -> [u64; 3] {
        let traffic = self.exchange.traffic();
        [traffic.exchanges, traffic.messages, traffic.bytes]
    }

    /// Ghosts become their owners' values.
    pub fn update_ghosts<T: Item>(&self, x: &mut [T]) {
        self.exchange.update_ghosts(x);
    }

    /// Sum over ranks of each entry.
    pub fn sum_all(&self, x: &mut [f64]) {
        self.comm.sum_all(x);
    }

    /// Sum of counts over ranks.
    pub fn sum_u64(&self, x: u64) -> u64 {
        self.comm.sum_u64(x)
    }

    /// Products of f32 vectors over owned entries of all ranks, summed in f64: one reduction.
    pub fn dots<const N: usize>(&self, pairs: [(&Vec<f32>, &Vec<f32>); N]) -> [f64; N] {
        let n = self.n_owned();
        let mut sums = pairs.map(|(a, b)| dot_f32(&a[..n], &b[..n]));
        self.comm.sum_all(&mut sums);
        sums
    }

    /// Global numbers of this rank's aggregates: the first, and that of each local node's aggregate.
    pub fn name_aggregates(&self, aggregates: &[u32], count: usize) -> (u32, Vec<u32>) {
        let first = self.comm.exclusive_sum(count as u64) as u32;
        let mut name = vec![NONE; self.n_local()];
        for (name, &aggregate) in name.iter_mut().zip(aggregates) {
            if aggregate != NONE {
                *name = first + aggregate;
            }
        }
        self.update_ghosts(&mut name);
        (first, name)
    }

    /// The next level's nodes, owned aggregates first, and the local index there of each local
    /// node's aggregate.
    pub fn coarse_nodes(&self, aggregates: &[u32], count: usize) -> (IndexMap, Vec<u32>) {
        let (first, mut index) = self.name_aggregates(aggregates, count);
        let (owned, ghosts) = index.split_at_mut(self.n_owned());
        owned.copy_from_slice(aggregates);
        let mut seen: Vec<(u32, u32)> = (self.nodes.ghost_owner.iter().copied())
            .zip(ghosts.iter().copied())
            .filter(|ghost| ghost.1 != NONE)
            .collect();
        seen.sort_unstable();
        seen.dedup();
        for (name, &owner) in ghosts.iter_mut().zip(&self.nodes.ghost_owner) {
            if *name != NONE {
                let at = seen.binary_search(&(owner, *name)).expect("listed above");
                *name = (count + at) as u32;
            }
        }
        let owned = (0..count as u64).map(|i| u64::from(first) + i);
        let nodes = IndexMap {
            global: owned.chain(seen.iter().map(|ghost| u64::from(ghost.1))).collect(),
            n_owned: count,
            ghost_owner: seen.iter().map(|ghost| ghost.0).collect(),
        };
        (nodes, index)
    }

    /// The halo of the next level.
    pub fn coarse(&self, nodes: &IndexMap, pattern: &Pattern) -> Self {
        Self::new(&self.comm, nodes, &self.exchange.coarser(&self.comm, nodes), pattern)
    }

    /// All ranks' rows, in rank order, on every rank.
    pub fn gather(&self, rows: BlockCsr<1>) -> BlockCsr<1> {
        if self.comm.size() == 1 {
            return rows;
        }
        // Lengths, columns and values of the rows in one list: one gather. A column is exact as f64.
        let row_start = &rows.pattern.row_start;
        let mut mine = vec![rows.n_rows() as f64];
        mine.extend(row_start.windows(2).map(|ends| f64::from(ends[1] - ends[0])));
        mine.extend(rows.pattern.columns.iter().map(|&j| f64::from(j)));
        mine.extend(rows.values.iter().map(|v| v[0][0]));
        let (mut row_start, mut columns, mut values) = (vec![0], Vec::new(), Vec::new());
        for list in self.comm.all_gather(&mine) {
            let (lengths, rest) = list[1..].split_at(list[0] as usize);
            for length in lengths {
                row_start.push(row_start[row_start.len() - 1] + *length as u32);
            }
            let (theirs, entries) = rest.split_at(rest.len() / 2);
            columns.extend(theirs.iter().map(|&j| j as u32));
            values.extend(entries.iter().map(|&v| [[v]]));
        }
        BlockCsr { pattern: Arc::new(Pattern::new(row_start, columns)), values }
    }
}

/// The node graph of a rank's elements: what all matrices over its nodes share.
#[derive(Clone, Debug)]
pub struct NodeGraph {
    /// Their entries.
    pub pattern: Arc<Pattern>,
    places: Arc<ElementPlaces>,
    /// How their rows meet the ranks.
    pub halo: Halo,
}

impl NodeGraph {
    /// Of these elements; rows are the owned indices of `nodes`.
    pub fn new(
        comm: &Communicator,
        nodes: &IndexMap,
        exchange: &Exchange,
        tets: &[[u32; 4]],
    ) -> Self {
        let (pattern, places) = Pattern::of_elements(tets, nodes.n_owned);
        let halo = Halo::new(comm, nodes, exchange, &pattern);
        Self { pattern: Arc::new(pattern), places: Arc::new(places), halo }
    }

    /// Entries of row `tet[i]`, an owned node, for the four nodes of element `e`.
    #[inline]
    pub fn entries(&self, e: usize, tet: &[u32; 4], i: usize) -> [usize; 4] {
        let start = self.pattern.row_start[tet[i] as usize] as usize;
        let places = &self.places[e];
        std::array::from_fn(|j| match places[4 * i + j] {
            FAR => self.pattern.entry(tet[i], tet[j]) as usize,
            place => start + usize::from(place),
        })
    }
}

/// A matrix whose rows are spread over ranks.
#[derive(Clone, Copy, Debug)]
pub struct DistributedOperator<'a, M, const B: usize> {
    matrix: &'a M,
    halo: &'a Halo,
}

impl<'a, M: Rows<B>, const B: usize> DistributedOperator<'a, M, B> {
    /// `matrix` has the pattern `halo` was made for.
    pub fn new(matrix: &'a M, halo: &'a Halo) -> Self {
        Self { matrix, halo }
    }
}

impl<M: Rows<B>, const B: usize> Operator for DistributedOperator<'_, M, B> {
    fn apply<X: Value>(&self, x: &mut [X], y: &mut [f64]) {
        let (x, _) = x.as_chunks_mut::<B>();
        let (y, _) = y.as_chunks_mut::<B>();
        self.halo.exchange.update_ghosts_during(x, |x| {
            for rows in &self.halo.interior {
                self.matrix.multiply_rows(rows.start as usize..rows.end as usize, x, y);
            }
        });
        for rows in &self.halo.border {
            self.matrix.multiply_rows(rows.start as usize..rows.end as usize, x, y);
        }
        y[self.halo.n_owned()..].fill([0.0; B]);
    }
}

/// `Σ w_i a_i b_i` over owned entries of all ranks.
#[derive(Clone, Copy, Debug)]
pub struct OwnedProduct<'a> {
    comm: &'a Communicator,
    n: usize,
    weights: Option<&'a [f64]>,
}

impl<'a> OwnedProduct<'a> {
    /// The Euclidean product of vectors with B entries per node.
    pub fn plain<const B: usize>(halo: &'a Halo) -> Self {
        Self { comm: &halo.comm, n: B * halo.n_owned(), weights: None }
    }

    /// With one weight for each owned entry.
    pub fn weighted<const B: usize>(halo: &'a Halo, weights: &'a [f64]) -> Self {
        assert!(weights.len() >= B * halo.n_owned(), "a weight for each owned entry");
        Self { weights: Some(weights), ..Self::plain::<B>(halo) }
    }
}

impl InnerProduct for OwnedProduct<'_> {
    fn dots(&self, packed: &[f64], w: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let mut scaled = [0.0; PIECE];
        for at in (0..self.n).step_by(PIECE) {
            let here = at..self.n.min(at + PIECE);
            let piece = match self.weights {
                None => &w[here.clone()],
                Some(weights) => {
                    let scaled = &mut scaled[..here.len()];
                    for ((s, w), weight) in
                        scaled.iter_mut().zip(&w[here.clone()]).zip(&weights[here.clone()])
                    {
                        *s = w * weight;
                    }
                    &*scaled
                }
            };
            for (out, v) in out.iter_mut().zip(packed.chunks_exact(w.len())) {
                *out += dot(&v[here.clone()], piece);
            }
        }
        self.comm.sum_all(out);
    }
}

/// In eight sums, which the compiler keeps in SIMD lanes.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, a_rest) = a.as_chunks::<8>();
    let (b, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for l in 0..8 {
            sums[l] += a[l] * b[l];
        }
    }
    sums.iter().sum::<f64>() + a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum::<f64>()
}

fn dot_f32(a: &[f32], b: &[f32]) -> f64 {
    let (a, a_rest) = a.as_chunks::<8>();
    let (b, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        for l in 0..8 {
            sums[l] += f64::from(a[l]) * f64::from(b[l]);
        }
    }
    let rest = a_rest.iter().zip(b_rest).map(|(a, b)| f64::from(*a) * f64::from(*b));
    sums.iter().sum::<f64>() + rest.sum::<f64>()
}
