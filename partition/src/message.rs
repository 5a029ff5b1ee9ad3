//! Plain data as bytes on the wire.
//!
//! Values are sent as the bytes they occupy: all ranks run the same program. An empty buffer is
//! never handed to MPI (its address may equal `MPI_IN_PLACE`), and no single message exceeds the
//! 32-bit counts of MPI.

use crate::cost::Waiting;
use mpi::datatype::{Buffer, BufferMut, Collection, Pointer, PointerMut};
use mpi::traits::{AsDatatype, Communicator as _, Destination, Equivalence, Source};
use std::ffi::c_void;
use std::marker::PhantomData;
use std::mem::{MaybeUninit, size_of_val};

/// What can be sent between ranks: plain data. Numbers, arrays and tuples of such are.
///
/// # Safety
/// The bytes of a value must mean the same value in another process of the same program: no
/// references, no pointers, no handles.
pub unsafe trait Item: Copy + 'static {}

/// Makes a structure of items an item: `item!(Pose { position, rotation });` names all its fields.
#[macro_export]
macro_rules! item {
    ($name:ident { $($field:ident),* $(,)? }) => {
        // SAFETY: all fields are items, as `every_field` checks.
        unsafe impl $crate::Item for $name {}
        const _: () = {
            fn is_item<T: $crate::Item>(_: T) {}
            #[allow(dead_code)]
            fn every_field($name { $($field),* }: $name) {
                $(is_item($field);)*
            }
        };
    };
}

/// Items that can be added: what ghosts contribute to their owners.
pub trait Accumulate: Item {
    /// `self += other`.
    fn accumulate(&mut self, other: Self);
}

macro_rules! numbers {
    ($($t:ty)*) => {$(
        // SAFETY: a number is its bytes.
        unsafe impl Item for $t {}
        impl Accumulate for $t {
            fn accumulate(&mut self, other: Self) {
                *self += other;
            }
        }
    )*};
}
numbers!(f64 f32 u64 i64 u32 i32 u16 i16 u8 i8 usize isize);

// SAFETY: made of nothing but items (padding is copied, never read).
unsafe impl Item for () {}
unsafe impl Item for bool {}
unsafe impl<T: Item, const N: usize> Item for [T; N] {}
unsafe impl<A: Item, B: Item> Item for (A, B) {}
unsafe impl<A: Item, B: Item, C: Item> Item for (A, B, C) {}
unsafe impl<A: Item, B: Item, C: Item, D: Item> Item for (A, B, C, D) {}
unsafe impl<T: Item> Item for Option<T> {}

impl<T: Accumulate, const N: usize> Accumulate for [T; N] {
    fn accumulate(&mut self, other: Self) {
        for (a, b) in self.iter_mut().zip(other) {
            a.accumulate(b);
        }
    }
}

/// Longest single message [bytes].
const LONGEST: usize = 1 << 30;

/// Bytes that leave, borrowed from items.
pub(crate) struct Outgoing<'a>(*const u8, usize, PhantomData<&'a [u8]>);

/// Room for bytes that arrive, borrowed from items.
pub(crate) struct Incoming<'a>(*mut u8, usize, PhantomData<&'a mut [u8]>);

impl<'a> Outgoing<'a> {
    /// The messages that carry `items`: none if there are none.
    pub(crate) fn messages<T: Item>(items: &'a [T]) -> impl Iterator<Item = Self> + use<'a, T> {
        let (start, bytes) = (items.as_ptr().cast::<u8>(), size_of_val(items));
        pieces(bytes).map(move |(at, n)| Self(start.wrapping_add(at), n, PhantomData))
    }
    /// One buffer, also when empty (then at an address that means nothing to MPI).
    pub(crate) fn whole<T: Item>(items: &'a [T]) -> Self {
        static NOTHING: u64 = 0;
        let start =
            if items.is_empty() { (&raw const NOTHING).cast() } else { items.as_ptr().cast() };
        Self(start, size_of_val(items), PhantomData)
    }
}

impl<'a> Incoming<'a> {
    /// How many bytes it takes.
    pub(crate) fn bytes(&self) -> usize {
        self.1
    }
    /// The messages that fill `items`: none if there are none.
    pub(crate) fn messages<T: Item>(items: &'a mut [T]) -> impl Iterator<Item = Self> + use<'a, T> {
        let (start, bytes) = (items.as_mut_ptr().cast::<u8>(), size_of_val(items));
        pieces(bytes).map(move |(at, n)| Self(start.wrapping_add(at), n, PhantomData))
    }
    /// One buffer that is not empty, still without values.
    pub(crate) fn whole<T: Item>(items: &'a mut [MaybeUninit<T>]) -> Self {
        Self(items.as_mut_ptr().cast(), size_of_val(items), PhantomData)
    }
    /// As `messages`, for a list still without values.
    pub(crate) fn unset<T: Item>(
        items: &'a mut [MaybeUninit<T>],
    ) -> impl Iterator<Item = Self> + use<'a, T> {
        let (start, bytes) = (items.as_mut_ptr().cast::<u8>(), size_of_val(items));
        pieces(bytes).map(move |(at, n)| Self(start.wrapping_add(at), n, PhantomData))
    }
}

/// Offsets and lengths of the messages that `bytes` are cut into.
fn pieces(bytes: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..bytes).step_by(LONGEST).map(move |at| (at, LONGEST.min(bytes - at)))
}

/// Starts all sends and receives (peer, buffer), runs `meanwhile`, and waits until all have ended.
/// Messages between two ranks arrive in the order of the lists.
pub(crate) fn transfer<R>(
    sends: &[(usize, Outgoing)],
    receives: &mut [(usize, Incoming)],
    meanwhile: impl FnOnce() -> R,
) -> R {
    let world = mpi::topology::SimpleCommunicator::world();
    let mut waiting = Waiting::default();
    let result = mpi::request::scope(|scope| {
        let (mut arriving, mut leaving) =
            (Vec::with_capacity(receives.len()), Vec::with_capacity(sends.len()));
        waiting.during(|| {
            for (from, buffer) in receives.iter_mut() {
                let bytes = buffer.1;
                let peer = world.process_at_rank(*from as i32);
                arriving.push((*from, bytes, peer.immediate_receive_into(scope, buffer)));
            }
            for (to, buffer) in sends {
                leaving.push(world.process_at_rank(*to as i32).immediate_send(scope, buffer));
            }
        });
        let result = meanwhile();
        waiting.during(|| {
            for (from, bytes, request) in arriving {
                let arrived = request.wait().count(u8::equivalent_datatype()) as usize;
                assert!(arrived == bytes, "{arrived} bytes from rank {from}, {bytes} agreed");
            }
            for request in leaving {
                request.wait_without_status();
            }
        });
        result
    });
    waiting.count([sends.len(), sends.iter().map(|(_, buffer)| buffer.1).sum(), 0, 0]);
    result
}

// SAFETY: pointer and count describe the borrowed bytes.
unsafe impl Pointer for Outgoing<'_> {
    fn pointer(&self) -> *const c_void {
        self.0.cast()
    }
}
unsafe impl Collection for Outgoing<'_> {
    fn count(&self) -> mpi::Count {
        self.1 as mpi::Count
    }
}
unsafe impl AsDatatype for Outgoing<'_> {
    type Out = <u8 as Equivalence>::Out;
    fn as_datatype(&self) -> Self::Out {
        u8::equivalent_datatype()
    }
}
unsafe impl Buffer for Outgoing<'_> {}
unsafe impl PointerMut for Incoming<'_> {
    fn pointer_mut(&mut self) -> *mut c_void {
        self.0.cast()
    }
}
unsafe impl Collection for Incoming<'_> {
    fn count(&self) -> mpi::Count {
        self.1 as mpi::Count
    }
}
unsafe impl AsDatatype for Incoming<'_> {
    type Out = <u8 as Equivalence>::Out;
    fn as_datatype(&self) -> Self::Out {
        u8::equivalent_datatype()
    }
}
unsafe impl BufferMut for Incoming<'_> {}
