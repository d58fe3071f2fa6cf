//! Tables of the panel: rays, acceleration structure, memory and the picked pixel.

use egui::{Grid, Ui};

use crate::{
    frame::Profile,
    gpu::MemoryUse,
    view::{
        loaded_scene::LoadedScene,
        pick::{Picked, PickedRay},
    },
    world::TriangleOrigin,
};

/// Shows rows of aligned cells.
pub fn grid<const N: usize>(ui: &mut Ui, name: &str, rows: impl IntoIterator<Item = [String; N]>) {
    Grid::new(name).num_columns(N).spacing([10.0, 1.0]).show(ui, |ui| {
        for row in rows {
            for cell in row {
                ui.monospace(cell);
            }
            ui.end_row();
        }
    });
}

/// Shows the numbers of rays and their rates: one row per bounce, and one row for all shadow rays.
pub fn rays(ui: &mut Ui, profile: &Profile) {
    grid(ui, "rays", ray_rows(profile));
}

fn ray_rows(profile: &Profile) -> Vec<[String; 5]> {
    let head = ["", "rays", "hits", "shadow", "Mrays/s"].map(str::to_owned);
    let rows = profile.bounces.iter().enumerate().map(|(bounce, stats)| {
        [
            bounce.to_string(),
            stats.n_rays.to_string(),
            stats.n_hits.to_string(),
            stats.n_shadow_rays.to_string(),
            rate(stats.n_rays, profile.tracing_ms(bounce as u32)),
        ]
    });
    let n_shadow_rays = profile.bounces.iter().map(|stats| stats.n_shadow_rays).sum::<u64>();
    let shadow_rate = rate(n_shadow_rays, profile.shadow_ms());
    let shadow = ["shadow".to_owned(), String::new(), String::new(), n_shadow_rays.to_string(), shadow_rate];
    std::iter::once(head).chain(rows).chain([shadow]).collect()
}

/// Returns million rays per second, or a dash if the time is unknown or 0.
fn rate(n_rays: u64, ms: Option<f64>) -> String {
    match ms {
        Some(ms) if ms > 0.0 => format!("{:.2}", n_rays as f64 / ms / 1e3),
        _ => "-".to_owned(),
    }
}

/// Shows the figures of the acceleration structure.
pub fn accel(ui: &mut Ui, loaded: &LoadedScene) {
    let statistics = &loaded.statistics;
    let size = ("size", bytes(statistics.bytes()));
    let built_in = ("built in", format!("{:.0} ms", loaded.built.build_ms));
    let rows = statistics.rows().into_iter().chain([size, built_in]);
    grid(ui, "tree", rows.map(|(name, value)| [name.to_owned(), value]));
}

/// Shows the device's memory by use.
pub fn memory(ui: &mut Ui, memory: &[MemoryUse]) {
    let all = MemoryUse { name: "all".to_owned(), bytes: memory.iter().map(|used| used.bytes).sum() };
    grid(ui, "memory", memory.iter().chain([&all]).map(|used| [used.name.clone(), bytes(used.bytes)]));
}

fn bytes(n: u64) -> String {
    match n {
        0..1024 => format!("{n} B"),
        1024..1_048_576 => format!("{:.1} KiB", n as f64 / 1024.0),
        _ => format!("{:.1} MiB", n as f64 / 1_048_576.0),
    }
}

/// Shows the rays of the picked pixel.
pub fn picked(ui: &mut Ui, picked: &Picked) {
    ui.monospace(format!("pixel {}, {}", picked.pixel.x, picked.pixel.y));
    for ray in &picked.rays {
        ui.monospace(picked_ray(ray));
    }
    if picked.n_more > 0 {
        ui.monospace(format!("and {} rays more", picked.n_more));
    }
}

fn picked_ray(ray: &PickedRay) -> String {
    let PickedRay { depth, throughput, steps, hit } = ray;
    let hit = match hit {
        None => "leaves the scene".to_owned(),
        Some(hit) => {
            let [x, y, z] = hit.point_world.to_array();
            let TriangleOrigin { instance_ix, mesh_ix, face_ix } = hit.origin;
            format!(
                "instance {instance_ix}, mesh {mesh_ix}, face {face_ix} ({})\n  at {x:.3} {y:.3} {z:.3}, {:.3} away",
                hit.material, hit.distance
            )
        }
    };
    let [r, g, b] = throughput.to_array();
    format!(
        "{depth}: {hit}\n  {} nodes, {} links, {} triangles\n  weighs {r:.2} {g:.2} {b:.2}",
        steps.n_nodes, steps.n_links, steps.n_triangles
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::{BounceStats, PassTime};

    #[test]
    fn rates_count_the_passes_that_find_hits() {
        let pass = |name, bounce, ms| PassTime { name, bounce, ms: Some(ms), ..PassTime::default() };
        let passes = vec![
            pass("rasterize_triangles", None, 0.75),
            pass("rasterize_blocks", None, 0.25),
            pass("primary_hit", Some(0), 1.0),
            pass("compact_scatter", Some(0), 9.0),
            pass("trace", Some(1), 3.0),
            pass("shadow", None, 4.0),
        ];
        let bounces = [4000, 600].map(|n_rays| BounceStats { n_rays, n_hits: 0, n_shadow_rays: 1000 }).to_vec();
        let rows = ray_rows(&Profile { passes, bounces, ..Profile::default() });
        let rates: Vec<_> = rows.iter().map(|row| &*row[4]).collect();
        assert_eq!(rates, ["Mrays/s", "2.00", "0.20", "0.50"]);
        assert_eq!((rate(1, None), rate(1, Some(0.0))), ("-".to_owned(), "-".to_owned()));
    }

    #[test]
    fn sizes_have_units() {
        assert_eq!([bytes(10), bytes(1536), bytes(3 << 20)], ["10 B", "1.5 KiB", "3.0 MiB"]);
    }
}
