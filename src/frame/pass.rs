//! The passes of a frame: what each one works for, and how often it runs.

/// What a pass works for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Finds the triangle that each pixel shows, before there is any ray.
    PrimaryVisibility,
    /// Finds the closest hits of a bounce's rays.
    ClosestHit,
    /// Tests the segments between hits and lights.
    Shadow,
    /// Computes radiance at the hits and adds it to the pixels.
    Light,
    /// Makes the rays of the next bounce, without gaps between them.
    Compaction,
    /// Works on pixels: samples, features, filter, display.
    Image,
}

/// How often a frame runs a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Once.
    Frame,
    /// Once for each batch, for the rays of all its bounces together.
    Batch,
    /// Once for each bounce of each batch.
    Bounce,
}

/// One pass, by the name of its kernel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pass {
    pub name: &'static str,
    pub role: Role,
    pub scope: Scope,
    /// The pass's colour in graphs, sRGB.
    pub color: [u8; 3],
}

impl Pass {
    /// Every pass that a frame can have, on the GPU and on the CPU.
    pub const ALL: [Self; 16] = [
        Self::new("visibility", Role::PrimaryVisibility, Scope::Frame, [120, 190, 255]),
        Self::new("rasterize_triangles", Role::PrimaryVisibility, Scope::Frame, [110, 225, 235]),
        Self::new("rasterize_blocks", Role::PrimaryVisibility, Scope::Frame, [60, 160, 170]),
        Self::new("primary_hit", Role::ClosestHit, Scope::Bounce, [70, 130, 220]),
        Self::new("trace", Role::ClosestHit, Scope::Bounce, [240, 130, 60]),
        Self::new("features", Role::Image, Scope::Bounce, [60, 160, 90]),
        Self::new("compact_reduce", Role::Compaction, Scope::Bounce, [200, 90, 110]),
        Self::new("compact_spine", Role::Compaction, Scope::Bounce, [225, 120, 135]),
        Self::new("compact_scatter", Role::Compaction, Scope::Bounce, [245, 160, 165]),
        Self::new("shadow", Role::Shadow, Scope::Batch, [150, 110, 200]),
        Self::new("shade", Role::Light, Scope::Batch, [250, 210, 90]),
        Self::new("resolve", Role::Light, Scope::Batch, [110, 200, 120]),
        Self::new("accumulate", Role::Image, Scope::Frame, [210, 180, 240]),
        Self::new("denoise", Role::Image, Scope::Frame, [80, 180, 180]),
        Self::new("false_color", Role::Image, Scope::Frame, [190, 140, 140]),
        Self::new("tonemap", Role::Image, Scope::Frame, [170, 170, 170]),
    ];

    const fn new(name: &'static str, role: Role, scope: Scope, color: [u8; 3]) -> Self {
        Self { name, role, scope, color }
    }

    /// The pass of a name.
    ///
    /// # Panics
    /// No pass of a frame has that name.
    pub fn named(name: &str) -> &'static Self {
        let pass = Self::ALL.iter().find(|pass| pass.name == name);
        pass.unwrap_or_else(|| panic!("`{name}` is missing in the table of a frame's passes"))
    }

    /// Whether the closest hits of rays have to wait for it.
    pub fn is_tracing(&self) -> bool {
        matches!(self.role, Role::PrimaryVisibility | Role::ClosestHit)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn each_pass_has_a_name_and_a_colour_of_its_own() {
        let names: BTreeSet<_> = Pass::ALL.iter().map(|pass| pass.name).collect();
        let colors: BTreeSet<_> = Pass::ALL.iter().map(|pass| pass.color).collect();
        assert_eq!((names.len(), colors.len()), (Pass::ALL.len(), Pass::ALL.len()));
        assert!(Pass::ALL.iter().all(|pass| Pass::named(pass.name) == pass && pass.color != [255; 3]));
    }
}
