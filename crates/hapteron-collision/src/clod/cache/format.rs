//! Bytes of a cached hierarchy, little-endian:
//! `HPTRCLOD`, version u32, key (32 bytes), checksum of all that follows (BLAKE3, 32 bytes), then levels u32, six counts u64,
//! and the six lists.

use super::key;
use super::validate::validate;
use crate::clod::middle::middles;
use crate::clod::{Hierarchy, Node, Sample, format_version};
use crate::surface::Surface;

const MAGIC: &[u8; 8] = b"HPTRCLOD";
const HEADER: usize = 8 + 4 + 32 + 32;
const NODE: usize = 13 * 8 + 14 * 4;

/// Why a file was not used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Refused {
    /// Not a file of this kind.
    #[error("it is not a contact hierarchy")]
    NotAHierarchy,
    /// From another version of the program.
    #[error("it was written by another version")]
    OtherVersion,
    /// Of another mesh.
    #[error("it belongs to another mesh")]
    OtherMesh,
    /// The checksum does not fit, or it ends too early or too late.
    #[error("it is damaged")]
    Damaged,
    /// The checksum fits, but what it says is impossible.
    #[error("it contradicts itself ({0})")]
    Impossible(&'static str),
}

impl Hierarchy {
    /// The hierarchy as the bytes of a cache file.
    #[must_use]
    pub fn to_bytes(&self, surface: &Surface) -> Vec<u8> {
        let mut body = Writer(Vec::with_capacity(self.memory_bytes()));
        body.u32(self.levels);
        for count in [
            self.nodes.len(),
            self.hull_vertices.len(),
            self.faces.len(),
            self.triangles.len(),
            self.vertices.len(),
            self.samples.len(),
        ] {
            body.0.extend((count as u64).to_le_bytes());
        }
        self.nodes.iter().for_each(|n| body.node(n));
        self.hull_vertices.iter().flatten().for_each(|&c| body.f64(c));
        self.faces.iter().for_each(|f| body.0.extend(f));
        self.triangles.iter().for_each(|&t| body.u32(t));
        self.vertices.iter().for_each(|&v| body.u32(v));
        for s in &self.samples {
            body.u32(s.vertex);
            body.u32(s.weight.to_bits());
        }
        let mut file = Vec::with_capacity(HEADER + body.0.len());
        file.extend(MAGIC);
        file.extend(format_version().to_le_bytes());
        file.extend(key(surface));
        file.extend(blake3::hash(&body.0).as_bytes());
        file.extend(body.0);
        file
    }

    /// Reads the bytes of a cache file; nothing in them is trusted.
    ///
    /// # Errors
    /// What is wrong with them.
    pub fn from_bytes(bytes: &[u8], surface: &Surface) -> Result<Self, Refused> {
        if bytes.len() < HEADER || &bytes[..8] != MAGIC {
            return Err(Refused::NotAHierarchy);
        }
        if bytes[8..12] != format_version().to_le_bytes() {
            return Err(Refused::OtherVersion);
        }
        if bytes[12..44] != key(surface) {
            return Err(Refused::OtherMesh);
        }
        let body = &bytes[HEADER..];
        if blake3::hash(body).as_bytes() != &bytes[44..HEADER] {
            return Err(Refused::Damaged);
        }
        Self::from_body(body, surface)
    }

    /// Reads what follows the header.
    ///
    /// # Errors
    /// What is wrong with it.
    #[doc(hidden)]
    pub fn from_body(body: &[u8], surface: &Surface) -> Result<Self, Refused> {
        let mut reader = Reader { rest: body };
        let levels = reader.u32()?;
        let mut counts = [0usize; 6];
        for count in &mut counts {
            let value = u64::from_le_bytes(reader.take()?);
            *count = usize::try_from(value).map_err(|_| Refused::Damaged)?;
        }
        let sizes = [NODE, 24, 3, 4, 4, 8];
        let needed = counts.iter().zip(sizes).try_fold(0usize, |sum, (&count, size)| {
            count.checked_mul(size).and_then(|bytes| sum.checked_add(bytes))
        });
        if needed != Some(reader.rest.len()) {
            return Err(Refused::Damaged);
        }
        let [nodes, hull_vertices, faces, triangles, vertices, samples] = counts;
        let mut hierarchy = Self {
            nodes: (0..nodes).map(|_| reader.node()).collect::<Result<_, _>>()?,
            middles: Vec::new(),
            hull_vertices: (0..hull_vertices).map(|_| reader.vec3()).collect::<Result<_, _>>()?,
            faces: (0..faces).map(|_| reader.take()).collect::<Result<_, _>>()?,
            triangles: (0..triangles).map(|_| reader.u32()).collect::<Result<_, _>>()?,
            vertices: (0..vertices).map(|_| reader.u32()).collect::<Result<_, _>>()?,
            samples: (0..samples).map(|_| reader.sample()).collect::<Result<_, _>>()?,
            levels,
            identity: surface.identity,
        };
        validate(&hierarchy, surface).map_err(Refused::Impossible)?;
        hierarchy.middles = middles(surface, &hierarchy.nodes, &hierarchy.vertices);
        Ok(hierarchy)
    }
}

struct Writer(Vec<u8>);

impl Writer {
    fn u32(&mut self, value: u32) {
        self.0.extend(value.to_le_bytes());
    }

    fn f64(&mut self, value: f64) {
        self.0.extend(value.to_bits().to_le_bytes());
    }

    fn node(&mut self, n: &Node) {
        let numbers = [n.radius, n.low, n.high, n.edge, n.deviation, n.margin];
        n.center.iter().chain(&n.normal).chain(&numbers).for_each(|&c| self.f64(c));
        self.u32(n.level);
        self.u32(n.parent);
        let ranges = [n.children, n.hull, n.faces, n.triangles, n.vertices, n.samples];
        ranges.iter().flatten().for_each(|&i| self.u32(i));
        self.f64(n.support);
    }
}

struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Refused> {
        let (first, rest) = self.rest.split_first_chunk::<N>().ok_or(Refused::Damaged)?;
        self.rest = rest;
        Ok(*first)
    }

    fn u32(&mut self) -> Result<u32, Refused> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn f64(&mut self) -> Result<f64, Refused> {
        Ok(f64::from_bits(u64::from_le_bytes(self.take()?)))
    }

    fn vec3(&mut self) -> Result<[f64; 3], Refused> {
        Ok([self.f64()?, self.f64()?, self.f64()?])
    }

    fn pair(&mut self) -> Result<[u32; 2], Refused> {
        Ok([self.u32()?, self.u32()?])
    }

    fn sample(&mut self) -> Result<Sample, Refused> {
        Ok(Sample { vertex: self.u32()?, weight: f32::from_bits(self.u32()?) })
    }

    fn node(&mut self) -> Result<Node, Refused> {
        let (center, normal) = (self.vec3()?, self.vec3()?);
        let [radius, low, high] = self.vec3()?;
        let [edge, deviation, margin] = self.vec3()?;
        Ok(Node {
            center,
            radius,
            normal,
            low,
            high,
            edge,
            deviation,
            margin,
            level: self.u32()?,
            parent: self.u32()?,
            children: self.pair()?,
            hull: self.pair()?,
            faces: self.pair()?,
            triangles: self.pair()?,
            vertices: self.pair()?,
            samples: self.pair()?,
            support: self.f64()?,
        })
    }
}
