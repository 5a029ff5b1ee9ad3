//! What a piece of work costs a rank: time, and what the rank says to others meanwhile.

use std::ops::{AddAssign, Sub};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};

/// Messages sent, their bytes, collectives, what this rank put into these [bytes], time in MPI, and of that the
/// processor's [ns]: of this process since it began. (A process is one rank.)
static COUNTS: [AtomicU64; 6] = [const { AtomicU64::new(0) }; 6];

/// What one rank spent on something.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cost {
    /// Wall time [s].
    pub seconds: f64,
    /// Of that, time for messages and collectives, most of it waiting for other ranks [s]. What is computed
    /// while messages are under way does not count.
    pub waiting: f64,
    /// Processor time outside of these [s]: work, also on a machine with more ranks than cores. 0 where the system
    /// does not tell.
    pub work: f64,
    /// Messages sent to single ranks.
    pub messages: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Calls in which all ranks take part.
    pub collectives: u64,
    /// What this rank put into those [bytes].
    pub collective_bytes: u64,
}

crate::item!(Cost { seconds, waiting, work, messages, bytes, collectives, collective_bytes });

impl AddAssign for Cost {
    fn add_assign(&mut self, other: Self) {
        self.seconds += other.seconds;
        self.waiting += other.waiting;
        self.work += other.work;
        self.messages += other.messages;
        self.bytes += other.bytes;
        self.collectives += other.collectives;
        self.collective_bytes += other.collective_bytes;
    }
}

impl Sub for Cost {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self {
            seconds: self.seconds - other.seconds,
            waiting: self.waiting - other.waiting,
            work: self.work - other.work,
            messages: self.messages - other.messages,
            bytes: self.bytes - other.bytes,
            collectives: self.collectives - other.collectives,
            collective_bytes: self.collective_bytes - other.collective_bytes,
        }
    }
}

/// A piece of work under way.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
    processor: Duration,
    before: [u64; 6],
}

impl Clock {
    /// From now on.
    pub fn start() -> Self {
        Self { start: Instant::now(), processor: processor_time(), before: counts() }
    }
    /// What this rank has spent since.
    pub fn elapsed(&self) -> Cost {
        let now = counts();
        let [messages, bytes, collectives, collective_bytes, waiting, in_mpi] =
            std::array::from_fn(|i| now[i] - self.before[i]);
        Cost {
            seconds: self.start.elapsed().as_secs_f64(),
            waiting: waiting as f64 * 1e-9,
            work: (processor_time() - self.processor).as_secs_f64() - in_mpi as f64 * 1e-9,
            messages,
            bytes,
            collectives,
            collective_bytes,
        }
    }
}

fn counts() -> [u64; 6] {
    std::array::from_fn(|i| COUNTS[i].load(Relaxed))
}

/// Time in MPI, wall's and processor's.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Waiting {
    wall: Duration,
    processor: Duration,
}

impl Waiting {
    /// Runs `call` and adds its time.
    pub(crate) fn during<R>(&mut self, call: impl FnOnce() -> R) -> R {
        let (start, processor) = (Instant::now(), processor_time());
        let result = call();
        self.wall += start.elapsed();
        self.processor += processor_time() - processor;
        result
    }
    /// Adds it to what this rank has spent, with messages and bytes, collectives and bytes.
    pub(crate) fn count(self, said: [usize; 4]) {
        let times = [self.wall, self.processor].map(|time| time.as_nanos() as u64);
        for (count, add) in COUNTS.iter().zip(said.map(|n| n as u64).into_iter().chain(times)) {
            count.fetch_add(add, Relaxed);
        }
    }
}

/// Counts a call in which all ranks take part, to which this one gives so many bytes.
pub(crate) fn collective<R>(bytes: usize, call: impl FnOnce() -> R) -> R {
    let mut waiting = Waiting::default();
    let result = waiting.during(call);
    waiting.count([0, 0, 1, bytes]);
    result
}

/// Time that this thread has spent on a processor.
#[cfg(target_os = "linux")]
fn processor_time() -> Duration {
    #[repr(C)]
    struct Time {
        seconds: i64,
        nanoseconds: std::ffi::c_long,
    }
    unsafe extern "C" {
        fn clock_gettime(clock: i32, time: *mut Time) -> i32;
    }
    const OF_THIS_THREAD: i32 = 3;
    let mut time = Time { seconds: 0, nanoseconds: 0 };
    // SAFETY: a function of the C library, which writes one such structure.
    unsafe { clock_gettime(OF_THIS_THREAD, &mut time) };
    Duration::new(time.seconds as u64, time.nanoseconds as u32)
}

#[cfg(not(target_os = "linux"))]
fn processor_time() -> Duration {
    Duration::ZERO
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn costs_add_up() {
        let clock = Clock::start();
        let pause = Duration::from_millis(3);
        let mut waiting = Waiting::default();
        waiting.during(|| std::thread::sleep(pause));
        waiting.count([2, 100, 0, 0]);
        assert_eq!(collective(8, || 7), 7);
        let mut x = 1u64;
        while clock.elapsed().work < 1e-3 && cfg!(target_os = "linux") {
            x = std::hint::black_box(x.wrapping_mul(3));
        }
        let cost = clock.elapsed();
        assert_eq!((cost.messages, cost.bytes), (2, 100));
        assert_eq!((cost.collectives, cost.collective_bytes), (1, 8));
        assert!(cost.waiting >= 3e-3 && cost.seconds >= cost.waiting + cost.work);
        let mut twice = cost;
        twice += cost;
        assert_eq!((twice - cost).bytes, 100);
    }
}
