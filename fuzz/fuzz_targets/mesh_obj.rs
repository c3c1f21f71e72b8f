//! OBJ files: an error or a mesh that everything downstream accepts.

#![no_main]

use hapteron_collision::mesh::Format;

mod mesh;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| mesh::read(bytes, Format::Obj));
