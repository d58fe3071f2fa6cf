//! Flat shapes: rectangles of fields, and discs. Both lie in the plane y = 0 and face up.

use glam::{Vec2, Vec3};
use serde::Deserialize;

use super::{TriangleBudget, count, length, rings::heading};
use crate::scene::model::{Mesh, error::Checked};

/// A rectangle of fields centred at the origin: 2 triangles per field. Field (i, k) has slot i + k, so two materials
/// make a checkerboard, or stripes if there is only one row of fields.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// Lengths along x and z.
    size: [f32; 2],
    /// Numbers of fields along x and z; 1 and 1 where absent.
    fields: Option<[u32; 2]>,
}

/// A fan of triangles around the origin, one per segment.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Disc {
    pub(crate) radius: f32,
    pub(crate) segments: u32,
}

impl Plane {
    pub fn build(&self, budget: &TriangleBudget) -> Checked<Mesh> {
        let [width, depth] = [length("size", self.size[0])?, length("size", self.size[1])?];
        let [n_x, n_z] = self.fields.unwrap_or([1, 1]);
        let (n_x, n_z) = (count("fields", n_x, 1)?, count("fields", n_z, 1)?);
        budget.require(2 * u64::from(n_x) * u64::from(n_z))?;
        let mut mesh = Mesh::default();
        for k in 0..=n_z {
            for i in 0..=n_x {
                let x = width * (f64::from(i) / f64::from(n_x) - 0.5);
                let z = depth * (f64::from(k) / f64::from(n_z) - 0.5);
                mesh.push_position(Vec3::new(x as f32, 0.0, z as f32));
            }
        }
        for k in 0..n_z {
            for i in 0..n_x {
                let back = k * (n_x + 1) + i;
                let front = back + n_x + 1;
                mesh.push_flat([back, front, front + 1], i + k);
                mesh.push_flat([back, front + 1, back + 1], i + k);
            }
        }
        set_uvs(&mut mesh, [width, depth]);
        Ok(mesh)
    }
}

impl Disc {
    pub fn build(&self, budget: &TriangleBudget) -> Checked<Mesh> {
        let radius = length("radius", self.radius)?;
        let n = count("segments", self.segments, 3)?;
        budget.require(u64::from(n))?;
        let mut mesh = Mesh::default();
        let centre = mesh.push_position(Vec3::ZERO);
        for ix in 0..n {
            mesh.push_position((radius * heading(f64::from(ix) / f64::from(n))).as_vec3());
        }
        for ix in 0..n {
            mesh.push_flat([centre, 1 + ix, 1 + (ix + 1) % n], 0);
        }
        set_uvs(&mut mesh, [2.0 * radius; 2]);
        Ok(mesh)
    }
}

/// Gives a flat mesh texture coordinates: u grows with x and v with z, from 0 to 1 over the `size` along x and z. From
/// above, with -z at the top, the image is upright.
fn set_uvs(mesh: &mut Mesh, size: [f64; 2]) {
    let uv = |p: Vec3| Vec2::new((f64::from(p.x) / size[0] + 0.5) as f32, (f64::from(p.z) / size[1] + 0.5) as f32);
    mesh.uvs[0] = mesh.faces.iter().map(|face| face.map(|ix| uv(mesh.positions[ix as usize]))).collect();
}
