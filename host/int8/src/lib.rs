//! int8 kernels for the network's inference on the CPU: matrix products, 3x3 convolutions, and what lies between them.
//!
//! Activations are u8 with a zero point, weights s8 from -127 to 127, sums exact in i32; where AVX2 is all there is, activations up
//! to [`SMALL`] and weights up to [`NARROW`] are multiplied fastest. [`Kernels`] runs them on the best instructions that the
//! processor has ([`Level`]), on one thread or more, and gives the same bytes in every case: integer sums are exact, and floats
//! are computed in an order that is the same everywhere, products fused with sums at the same places.
//!
//! ```
//! use rfhoi_int8::{Affine, Kernels, Out, Packed};
//!
//! let weights = Packed::new(3, 2, &[1, 2, 3, -1, 0, 1]);
//! let mut y = [0.0; 2];
//! let affine = Affine { scale: &[0.5, 1.0], bias: &[0.0, 1.0], leak: 0.1 };
//! Kernels::best().linear(&[10, 20, 30], 1, &weights, affine, Out::F32(&mut y));
//! assert_eq!(y, [70.0, 21.0]);
//! ```
//!
//! * `isa`: the instructions of each level, a few for each; all kernels are written once, over these.
//! * `pack`: the weights' layout.
//! * `linear`, `conv`, `pool`, `norm`, `attention`: the kernels.
//! * `lanes`: floats, sixteen abreast. `out`: scale, bias, activation and quantisation. `threads`: a second core's share.

mod attention;
mod conv;
mod isa;
mod kernels;
mod lanes;
mod level;
mod linear;
mod norm;
mod out;
mod pack;
mod pool;
mod threads;

pub use conv::ConvShape;
pub use kernels::Kernels;
pub use level::{Level, UnknownLevel};
pub use out::{Affine, Out, Quant};
pub use pack::{NARROW, Packed, PackedConv, SMALL};
