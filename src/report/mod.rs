//! What a run tells: stage times, progress, gauges, files, the summary.

pub mod output;
pub mod stages;
