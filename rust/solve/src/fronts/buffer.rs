//! Zeroed memory for the factor and its work space.

use std::ops::{Deref, DerefMut};

use bytemuck::Pod;
use memmap2::MmapMut;

/// Bytes from which on the system is asked for pages of their own.
const MAPPED: usize = 1 << 20;
/// Bytes of a cache line.
const LINE: usize = 64;

/// Zeroed numbers that start on a cache line. Large ones use huge pages where the system has them: touching a fresh page
/// of 4 KB costs more than all arithmetic done on its 512 numbers.
#[derive(Debug)]
pub(crate) struct Buffer<T = f64> {
    memory: Memory<T>,
    start: usize,
    len: usize,
}

#[derive(Debug)]
enum Memory<T> {
    Heap(Vec<T>),
    Pages(MmapMut),
}

impl<T: Pod> Buffer<T> {
    pub(crate) fn zeroed(len: usize) -> Self {
        let (bytes, line) = (len * size_of::<T>(), LINE / size_of::<T>());
        if let Some(pages) = (bytes >= MAPPED).then(|| huge_pages(bytes)).flatten() {
            return Self { memory: Memory::Pages(pages), start: 0, len };
        }
        let heap = vec![T::zeroed(); len + line];
        let start = heap.as_ptr().align_offset(LINE).min(line);
        Self { memory: Memory::Heap(heap), start, len }
    }

    /// At least so many numbers of a buffer that is used again and again, whatever they are.
    pub(crate) fn at_least(kept: &mut Option<Self>, len: usize) -> &mut [T] {
        if kept.as_ref().is_none_or(|kept| kept.len < len) {
            // First give back what is too short.
            *kept = None;
        }
        &mut kept.get_or_insert_with(|| Self::zeroed(len))[..len]
    }
}

fn huge_pages(bytes: usize) -> Option<MmapMut> {
    let pages = MmapMut::map_anon(bytes).ok()?;
    #[cfg(target_os = "linux")]
    // Where this is refused, small pages do.
    let _ = pages.advise(memmap2::Advice::HugePage);
    Some(pages)
}

impl<T: Pod> Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        let memory = match &self.memory {
            Memory::Heap(heap) => heap,
            Memory::Pages(pages) => bytemuck::cast_slice(pages),
        };
        &memory[self.start..self.start + self.len]
    }
}

impl<T: Pod> DerefMut for Buffer<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        let memory = match &mut self.memory {
            Memory::Heap(heap) => heap,
            Memory::Pages(pages) => bytemuck::cast_slice_mut(pages),
        };
        &mut memory[self.start..self.start + self.len]
    }
}
