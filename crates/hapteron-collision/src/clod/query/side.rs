//! One surface searching on the other.

use crate::surface::Surface;
use crate::vector::Rigid;
use fearless_simd::Level;

/// One side of a query.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    pub own: &'a Surface,
    pub other: &'a Surface,
    /// From the own frame to the other's.
    pub motion: &'a Rigid,
    /// The same at the last query.
    pub last: &'a Rigid,
    /// The instructions that the machine has.
    pub level: Level,
    pub tolerance: f64,
    /// How far the surfaces have moved in all.
    pub travelled: f64,
}
