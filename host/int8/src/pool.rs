//! Max-pooling of codes.

use crate::isa::{Isa, Work};

/// The greatest code of each square of `size` by `size` pixels; rows and columns beyond whole squares are left out.
#[derive(Debug)]
pub(crate) struct MaxPool<'a> {
    /// `[channels][height][width]`.
    pub(crate) input: &'a [u8],
    pub(crate) height: usize,
    pub(crate) width: usize,
    pub(crate) size: usize,
    /// `[channels][height / size][width / size]`.
    pub(crate) out: &'a mut [u8],
}

/// Most pixels of a row at once.
const STRIP: usize = 64;

impl Work for MaxPool<'_> {
    #[inline(always)]
    fn run<I: Isa>(self, _: I) {
        match self.size {
            2 => self.squares::<2>(),
            4 => self.squares::<4>(),
            8 => self.squares::<8>(),
            _ => self.any(),
        }
    }
}

impl MaxPool<'_> {
    /// Strips of rows, a register wide: down first, then across.
    #[inline(always)]
    fn squares<const SIZE: usize>(self) {
        let (rows, columns) = (self.height / SIZE, self.width / SIZE);
        let planes = self.input.chunks_exact(self.height * self.width);
        for (plane, out) in planes.zip(self.out.chunks_exact_mut(rows * columns)) {
            for (rows, out) in plane.chunks_exact(SIZE * self.width).zip(out.chunks_exact_mut(columns)) {
                for (strip, out) in out.chunks_mut(STRIP / SIZE).enumerate() {
                    let used = out.len() * SIZE;
                    let mut greatest = [0; STRIP];
                    for row in rows.chunks_exact(self.width) {
                        let row = &row[strip * STRIP..][..used];
                        if let Some(row) = row.as_array::<STRIP>() {
                            down(&mut greatest, row);
                        } else {
                            down(&mut greatest, row);
                        }
                    }
                    let mut squares = [0; STRIP];
                    for (square, codes) in squares.iter_mut().zip(greatest.as_chunks::<SIZE>().0) {
                        *square = codes.iter().fold(0, |greatest, &code| greatest.max(code));
                    }
                    out.copy_from_slice(&squares[..out.len()]);
                }
            }
        }
    }

    #[inline(always)]
    fn any(self) {
        let (rows, columns) = (self.height / self.size, self.width / self.size);
        let planes = self.input.chunks_exact(self.height * self.width);
        for (plane, out) in planes.zip(self.out.chunks_exact_mut(rows * columns)) {
            for (rows, out) in plane.chunks_exact(self.size * self.width).zip(out.chunks_exact_mut(columns)) {
                for (column, out) in out.iter_mut().enumerate() {
                    *out = 0;
                    for row in rows.chunks_exact(self.width) {
                        for &code in &row[column * self.size..][..self.size] {
                            *out = (*out).max(code);
                        }
                    }
                }
            }
        }
    }
}

#[inline(always)]
fn down(greatest: &mut [u8; STRIP], row: &[u8]) {
    for (greatest, &code) in greatest.iter_mut().zip(row) {
        *greatest = (*greatest).max(code);
    }
}
