//! The line that tells how a run is getting on: rewritten in place on a terminal, plain lines in a log.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Progress of a run, shown by the first rank.
pub struct Progress {
    shown: bool,
    terminal: bool,
    started: Instant,
    last: Option<Instant>,
    t_start: f64,
    t_end: f64,
}

/// What the line tells.
#[derive(Clone, Copy, Debug, Default)]
pub struct Line {
    /// Time [s].
    pub t: f64,
    /// Steps done.
    pub step: u64,
    /// Last step [s].
    pub dt: f64,
    /// Courant number.
    pub courant: f64,
    /// Iterations of the flow's solver.
    pub iterations: u32,
    /// Volume error relative to the water there is.
    pub volume_error: f64,
    /// Whether there is a fluid at all.
    pub fluid: bool,
}

impl Progress {
    /// From `t_start` to `t_end` [s]; silent unless `shown`.
    pub fn new(shown: bool, t_start: f64, t_end: f64) -> Self {
        // mpirun makes standard output look like a terminal, but not standard error.
        let terminal = std::io::stdout().is_terminal() && std::io::stderr().is_terminal();
        Self { shown, terminal, started: Instant::now(), last: None, t_start, t_end }
    }

    /// Something that happened, on a line of its own.
    pub fn tell(&mut self, what: &str) {
        if self.shown {
            let clear = if self.terminal { "\r\x1b[K" } else { "" };
            let _ = writeln!(std::io::stdout().lock(), "{clear}{what}");
        }
    }

    /// Shows the line if the last one is old enough, or if it is the last of all.
    pub fn show(&mut self, line: &Line, finished: bool) {
        if !self.shown {
            return;
        }
        let pause = Duration::from_millis(if self.terminal { 200 } else { 5000 });
        if !finished && self.last.is_some_and(|last| last.elapsed() < pause) {
            return;
        }
        self.last = Some(Instant::now());
        let elapsed = self.started.elapsed().as_secs_f64();
        let done = (line.t - self.t_start) / (self.t_end - self.t_start);
        let left = if done > 0.0 { elapsed * (1.0 - done).max(0.0) / done } else { f64::NAN };
        let Line { t, step, dt, courant, iterations, volume_error, fluid } = line;
        let mut text = format!("t {t:.4} s of {} · step {step} · Δt {dt:.2e} s · ", self.t_end);
        if *fluid {
            text += &format!("{iterations} its · Courant {courant:.2} · ");
            text += &format!("volume error {volume_error:+.1e} · ");
        }
        text += &format!("{} left", duration(left));
        let mut out = std::io::stdout().lock();
        // A terminal that has gone away is no reason to stop.
        let _ = match (self.terminal, finished) {
            (true, false) => write!(out, "\r\x1b[K{text}").and_then(|()| out.flush()),
            (true, true) => writeln!(out, "\r\x1b[K{text}"),
            (false, _) => writeln!(out, "{text}"),
        };
    }
}

/// Seconds as a person reads them.
pub fn duration(seconds: f64) -> String {
    if !seconds.is_finite() {
        return "?".into();
    }
    let s = seconds.round() as u64;
    match s {
        0..60 => format!("{s} s"),
        60..3600 => format!("{}:{:02} min", s / 60, s % 60),
        _ => format!("{}:{:02} h", s / 3600, s / 60 % 60),
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn durations_as_people_read_them() {
        assert_eq!(super::duration(59.4), "59 s");
        assert_eq!(super::duration(61.0), "1:01 min");
        assert_eq!(super::duration(7260.0), "2:01 h");
        assert_eq!(super::duration(f64::NAN), "?");
    }
}
