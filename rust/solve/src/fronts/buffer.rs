//! Zeroed memory for the factor and its work space.

use std::ops::{Deref, DerefMut};

use memmap2::MmapMut;

/// Lengths (in numbers) from here on ask the system for pages of their own.
const MAPPED: usize = 1 << 17;
/// Numbers of a cache line.
const LINE: usize = 8;

/// Zeroed numbers that start on a cache line. Large ones use huge pages where the system has them: touching a fresh page
/// of 4 KB costs more than all arithmetic done on its 512 numbers.
#[derive(Debug)]
pub(crate) struct Buffer {
    memory: Memory,
    start: usize,
    len: usize,
}

#[derive(Debug)]
enum Memory {
    Heap(Vec<f64>),
    Pages(MmapMut),
}

impl Buffer {
    pub(crate) fn zeroed(len: usize) -> Self {
        if let Some(pages) = (len >= MAPPED).then(|| huge_pages(len)).flatten() {
            return Self { memory: Memory::Pages(pages), start: 0, len };
        }
        let heap = vec![0.0; len + LINE];
        let start = heap.as_ptr().align_offset(LINE * size_of::<f64>()).min(LINE);
        Self { memory: Memory::Heap(heap), start, len }
    }
}

impl Buffer {
    /// At least so many numbers of a buffer that is used again and again, whatever they are.
    pub(crate) fn at_least(kept: &mut Option<Self>, len: usize) -> &mut [f64] {
        if kept.as_ref().is_none_or(|kept| kept.len < len) {
            // First give back what is too short.
            *kept = None;
        }
        &mut kept.get_or_insert_with(|| Self::zeroed(len))[..len]
    }
}

fn huge_pages(len: usize) -> Option<MmapMut> {
    let pages = MmapMut::map_anon(len * size_of::<f64>()).ok()?;
    #[cfg(target_os = "linux")]
    // Where this is refused, small pages do.
    let _ = pages.advise(memmap2::Advice::HugePage);
    Some(pages)
}

impl Deref for Buffer {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        let memory = match &self.memory {
            Memory::Heap(heap) => heap,
            Memory::Pages(pages) => bytemuck::cast_slice(pages),
        };
        &memory[self.start..self.start + self.len]
    }
}

impl DerefMut for Buffer {
    fn deref_mut(&mut self) -> &mut [f64] {
        let memory = match &mut self.memory {
            Memory::Heap(heap) => heap,
            Memory::Pages(pages) => bytemuck::cast_slice_mut(pages),
        };
        &mut memory[self.start..self.start + self.len]
    }
}
