//! Compressed rows of small dense blocks: rows are owned nodes, columns are local nodes.

/// Row-compressed matrix of B×B blocks (row-major inside a block).
#[derive(Clone, Debug)]
pub struct BlockCsr<const B: usize> {
    /// `row_start[i]..row_start[i+1]` are row i's entries; length rows + 1.
    pub row_start: Vec<u32>,
    /// Column (local node) of each entry, ascending within a row.
    pub columns: Vec<u32>,
    /// The blocks: `values[entry][r][c]`.
    pub values: Vec<[[f64; B]; B]>,
}

/// Where each element's 16 node pairs go: `slots[e][4 i + j]`, `u32::MAX` where row i is not owned.
pub type ElementSlots = Vec<[u32; 16]>;

impl<const B: usize> BlockCsr<B> {
    /// Zero matrix on the node graph of these elements: rows for the first `n_rows` nodes; and the
    /// slot map that assembly uses.
    pub fn of_elements(tets: &[[u32; 4]], n_rows: usize) -> (Self, ElementSlots) {
        let mut count = vec![0u32; n_rows + 1];
        for tet in tets {
            for &i in tet {
                if (i as usize) < n_rows {
                    count[i as usize + 1] += 4;
                }
            }
        }
        for i in 0..n_rows {
            count[i + 1] += count[i];
        }
        let mut raw = vec![0u32; count[n_rows] as usize];
        let mut next = count.clone();
        for tet in tets {
            for &i in tet {
                if (i as usize) < n_rows {
                    let at = next[i as usize] as usize;
                    raw[at..at + 4].copy_from_slice(tet);
                    next[i as usize] += 4;
                }
            }
        }
        let mut row_start = vec![0u32; n_rows + 1];
        let mut columns = Vec::new();
        for i in 0..n_rows {
            let row = &mut raw[count[i] as usize..count[i + 1] as usize];
            row.sort_unstable();
            let mut last = u32::MAX;
            for &j in row.iter() {
                if j != last {
                    columns.push(j);
                    last = j;
                }
            }
            row_start[i + 1] = columns.len() as u32;
        }
        let matrix = Self { values: vec![[[0.0; B]; B]; columns.len()], row_start, columns };
        let slots = tets
            .iter()
            .map(|tet| {
                std::array::from_fn(|p| {
                    let (i, j) = (tet[p / 4], tet[p % 4]);
                    if (i as usize) < n_rows { matrix.slot(i, j) } else { u32::MAX }
                })
            })
            .collect();
        (matrix, slots)
    }

    /// Zero matrix with the pattern of another.
    pub fn with_pattern_of<const C: usize>(other: &BlockCsr<C>) -> Self {
        Self {
            row_start: other.row_start.clone(),
            columns: other.columns.clone(),
            values: vec![[[0.0; B]; B]; other.columns.len()],
        }
    }

    /// Rows.
    pub fn n_rows(&self) -> usize {
        self.row_start.len() - 1
    }

    /// Entries of row i.
    #[inline]
    pub fn row(&self, i: usize) -> std::ops::Range<usize> {
        self.row_start[i] as usize..self.row_start[i + 1] as usize
    }

    /// Position of entry (i, j), which must exist.
    pub fn slot(&self, i: u32, j: u32) -> u32 {
        let row = self.row(i as usize);
        let at = self.columns[row.clone()].binary_search(&j).expect("entry of the node graph");
        (row.start + at) as u32
    }

    /// `y[i] = Σ_j A_ij x_j` for the given rows; `x` over local nodes, `y` at least over rows.
    ///
    /// Products are summed column by column of the block, so that they fill SIMD lanes.
    #[inline]
    pub fn multiply_rows(&self, rows: std::ops::Range<usize>, x: &[[f64; B]], y: &mut [[f64; B]]) {
        for i in rows {
            let row = self.row(i);
            let mut sum = [[0.0; B]; B];
            for (block, &j) in self.values[row.clone()].iter().zip(&self.columns[row]) {
                let xj = &x[j as usize];
                for r in 0..B {
                    for c in 0..B {
                        sum[r][c] += block[r][c] * xj[c];
                    }
                }
            }
            y[i] = sum.map(|lanes| lanes.iter().sum());
        }
    }

    /// Position of the diagonal entry of row i.
    #[inline]
    pub fn diagonal(&self, i: usize) -> usize {
        self.slot(i as u32, i as u32) as usize
    }

    /// All values zero.
    pub fn clear(&mut self) {
        self.values.fill([[0.0; B]; B]);
    }
}
