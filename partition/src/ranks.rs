//! The program's ranks: from the first line of `main` to the last.

use crate::Communicator;
use mpi::topology::SimpleCommunicator;
use mpi::traits::Communicator as _;
use std::backtrace::{Backtrace, BacktraceStatus};
use std::io::Write as _;

/// The running ranks; dropping it ends MPI, so it is made first in `main` and dropped last (after
/// every open parallel file).
pub struct Ranks {
    _universe: mpi::environment::Universe,
    world: Communicator,
}

impl Ranks {
    /// All ranks of the program.
    pub fn world(&self) -> Communicator {
        self.world.clone()
    }
}

/// Starts MPI: once in a program, first in `main`. Without `mpirun` the program is one rank.
///
/// From then on a panic on one of several ranks prints its message with the rank and ends all ranks:
/// the others would wait for it for ever.
pub fn start() -> Ranks {
    return_large_blocks();
    let universe = mpi::initialize().expect("the ranks are started once");
    let world = Communicator::world();
    if world.size() > 1 {
        let (rank, size) = (world.rank(), world.size());
        std::panic::set_hook(Box::new(move |panic| {
            let trace = Backtrace::capture();
            // In one write: several ranks may panic at once.
            let message = match trace.status() {
                BacktraceStatus::Captured => format!("rank {rank} of {size} {panic}\n{trace}\n"),
                _ => format!("rank {rank} of {size} {panic}\n"),
            };
            let _ = std::io::stderr().write_all(message.as_bytes());
            abort(101);
        }));
    }
    Ranks { _universe: universe, world }
}

/// Ends the program on all ranks at once, from any of them.
pub fn abort(code: i32) -> ! {
    if mpi::is_initialized() && !mpi::is_finalized() {
        SimpleCommunicator::world().abort(code)
    }
    std::process::exit(code)
}

/// Ends all ranks, collectively, without ending MPI: HDF5 would then close what could not be written to a full
/// disk once more, and crash.
pub fn leave(comm: &Communicator, code: i32) -> ! {
    unsafe extern "C" {
        fn _exit(code: i32) -> !;
    }
    // Not before the others are here, and have said what they had to say.
    comm.sum_u64(0);
    // SAFETY: a function of the C library without preconditions.
    unsafe { _exit(code) }
}

/// From now on what was freed of large blocks goes back to the system at once. glibc does so until a large one is
/// freed, and then keeps the like: an eighth of what a run on 100 000 nodes takes.
fn return_large_blocks() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        const M_MMAP_THRESHOLD: i32 = -3;
        const LARGE: i32 = 4 << 20; // [bytes]
        unsafe extern "C" {
            fn mallopt(parameter: i32, value: i32) -> i32;
        }
        // SAFETY: a function of glibc without preconditions.
        unsafe { mallopt(M_MMAP_THRESHOLD, LARGE) };
    }
}

/// Gives freed memory back to the system. Splitting and dealing out a mesh takes several times its
/// memory in small blocks, which glibc would keep beside all that the run itself needs.
pub fn return_memory() {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    {
        unsafe extern "C" {
            fn malloc_trim(pad: usize) -> i32;
        }
        // SAFETY: a function of glibc without preconditions.
        unsafe { malloc_trim(0) };
    }
}
