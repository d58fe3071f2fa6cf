//! Surfaces of revolution: columns, goblets, vases.

use glam::{DVec2, DVec3};
use serde::Deserialize;

use super::{
    TriangleBudget, count, length,
    rings::{Rings, SurfacePoint, heading},
};
use crate::scene::model::{Mesh, error::Checked};

/// A surface of revolution: a profile turned about the y axis. Each step of the profile makes 2 * segments triangles,
/// or half as many if it ends on the axis. The surface is closed if the profile begins and ends on the axis.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lathe {
    /// Points `[distance from the axis, height]`, from top to bottom along the outside. The outside is to the left of
    /// the profile's direction, so the profile of a vessel first runs up the inside. A smooth curve passes through
    /// the points. A point given twice is a sharp edge, and two points between sharp edges make a straight line.
    profile: Vec<[f32; 2]>,
    /// Number of points around the axis.
    segments: u32,
    /// Number of steps between two points of a curve; 8 where absent.
    steps: Option<u32>,
}

/// A point of the profile and the unit normal there.
type ProfilePoint = (DVec2, DVec2);

impl Lathe {
    pub fn build(&self, budget: &TriangleBudget) -> Checked<Mesh> {
        let segments = count("segments", self.segments, 3)?;
        let steps = count("steps", self.steps.unwrap_or(8), 1)?;
        budget.require(2 * u64::from(segments) * u64::from(steps) * self.profile.len() as u64)?;
        let points = self.profile.iter().map(|[r, y]| profile_point(*r, *y)).collect::<Checked<Vec<DVec2>>>()?;
        let mut mesh = Mesh::default();
        let n_spans = points.array_windows().filter(|[a, b]| a != b).count() as f32;
        let mut n_spans_before = 0.0;
        for run in points.chunk_by(|a, b| a != b) {
            let curve = curve(run, steps)?;
            // On the axis, a ring is a single point.
            let n_points = curve.iter().map(|(at, _)| if at.x == 0.0 { 1 } else { segments }).collect();
            let point = |ring: usize, around: f64| -> SurfacePoint {
                let (at, normal) = curve[ring];
                let turned = |v: DVec2| v.x * heading(around) + v.y * DVec3::Y;
                (turned(at), turned(normal))
            };
            let mut part = Rings { n_points, cyclic: false }.sweep(point);
            // Each span between two points of the profile has an equal share of the image's height.
            let n_spans_of_run = (run.len() - 1) as f32;
            part.uvs[0].iter_mut().flatten().for_each(|uv| uv.y = (n_spans_before + uv.y * n_spans_of_run) / n_spans);
            n_spans_before += n_spans_of_run;
            mesh.append(part);
        }
        Ok(mesh)
    }
}

fn profile_point(r: f32, y: f32) -> Checked<DVec2> {
    if r != 0.0 {
        length("a profile's distance from the axis", r)?;
    }
    crate::scene::model::material::within("a profile's height", y, -1e6, 1e6)?;
    Ok(DVec2::new(f64::from(r), f64::from(y)))
}

/// Returns the points of a run of the profile between sharp edges: a Catmull-Rom spline through `run`, or the two
/// ends of a straight line.
fn curve(run: &[DVec2], steps: u32) -> Checked<Vec<ProfilePoint>> {
    let [first, .., last] = run else {
        return Err(
            "the profile has a point that begins and ends nothing: a sharp edge is a point given twice".to_owned()
        );
    };
    if run[1..run.len() - 1].iter().any(|point| point.x == 0.0) {
        return Err("the profile touches the axis between its ends".to_owned());
    }
    if let [a, b] = run {
        let normal = left_of(*b - *a);
        return Ok(vec![(*a, pole_normal(*a, normal)), (*b, pole_normal(*b, normal))]);
    }
    let mut curve = Vec::new();
    let before = beyond(*first, run[1]);
    let after = beyond(*last, run[run.len() - 2]);
    let at = |ix: isize| *run.get(ix as usize).unwrap_or(if ix < 0 { &before } else { &after });
    for span in 0..run.len() as isize - 1 {
        let points = [at(span - 1), at(span), at(span + 1), at(span + 2)];
        curve.extend((0..steps).map(|step| catmull_rom(points, f64::from(step) / f64::from(steps))));
    }
    let end = run.len() as isize - 2;
    let (_, normal) = catmull_rom([at(end - 1), at(end), at(end + 1), at(end + 2)], 1.0);
    curve.push((*last, normal));
    match curve.iter().skip(1).rev().skip(1).find(|(at, _)| at.x <= 0.0) {
        Some((at, _)) => Err(format!("the profile's curve crosses the axis at height {}", at.y)),
        None => Ok(curve.into_iter().map(|(at, normal)| (at, pole_normal(at, normal))).collect()),
    }
}

/// Returns the control point beyond an end of the curve. If the curve ends on the axis, it is the mirror image of the
/// point next to the end, so that the tip is round.
fn beyond(end: DVec2, next: DVec2) -> DVec2 {
    if end.x == 0.0 { DVec2::new(-next.x, next.y) } else { 2.0 * end - next }
}

/// Returns the point of the spline between the second and the third control point, `t` from 0 to 1. At 0 it is
/// exactly the second one.
fn catmull_rom([a, b, c, d]: [DVec2; 4], t: f64) -> ProfilePoint {
    let (linear, square, cube) = ((c - a) / 2.0, a - 2.5 * b + 2.0 * c - 0.5 * d, (d - a) / 2.0 + 1.5 * (b - c));
    let at = b + t * (linear + t * (square + t * cube));
    (at, left_of(linear + t * (2.0 * square + t * 3.0 * cube)))
}

/// Returns the unit normal of a profile that runs along `way`.
fn left_of(way: DVec2) -> DVec2 {
    DVec2::new(-way.y, way.x).normalize_or_zero()
}

/// Returns the normal at a point. On the axis it is parallel to the axis.
fn pole_normal(at: DVec2, normal: DVec2) -> DVec2 {
    if at.x == 0.0 { DVec2::new(0.0, 1f64.copysign(normal.y)) } else { normal }
}
