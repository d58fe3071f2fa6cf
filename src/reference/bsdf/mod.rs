//! How surfaces of microfacets scatter light in the path tracer: the bidirectional scattering distribution function.
//! Twin of `bsdf/bsdf.glsl`, which describes the lobes.

mod albedo;
mod clearcoat;
mod conductor;
mod evaluate;
mod ggx;
mod lambert;
mod lobes;
pub(super) mod local_frame;
mod multiple_scattering;
mod reflection;
mod sample;
mod sheen;
mod solid_loss;
mod terms;
#[cfg(test)]
mod tests;
mod transmission;

pub use self::{
    evaluate::eval_bsdf,
    lobes::{hit_albedo, is_smooth, surface_albedo, surface_gloss},
    sample::sample_bsdf,
    terms::{BsdfTerms, bsdf_terms},
};
