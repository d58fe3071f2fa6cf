//! Grids of kept meshes that the device builds: the arrays have the grids of the host, bit for bit, at each moment of a
//! film.

use bytemuck::cast_slice;
use kdray::{
    accel::{AccelOptions, grid::Grid},
    buffers::SceneArrays,
    frame::Integrator,
    gpu::DeviceOverrides,
    layout::{GEOMETRY_ROWS, GeometryConstants, GridCell, INSTANCE_ROWS, LeafTriangle, Plane, Triangle},
    render::GpuRenderer,
    world::World,
};

use super::{
    deformed::{drawn, lazy_of, lazy_options, next_moment, renderer, scene},
    kept,
};
use crate::support::{assert_silent, compare, device, pretended};

/// Arrays of the scene that lead to grids.
struct Arrays {
    constants: Vec<GeometryConstants>,
    cells: Vec<GridCell>,
    entries: Vec<LeafTriangle>,
    planes: Vec<Plane>,
}

impl Arrays {
    fn of(arrays: &SceneArrays, world: &World) -> Self {
        let instances = world.scene().instances.as_ref().expect("instances");
        let rows = arrays.instance_rows.download().expect("rows");
        let rows = &rows[INSTANCE_ROWS as usize * instances.list.len()..];
        Self {
            constants: cast_slice(&rows[..GEOMETRY_ROWS as usize * instances.ranges.len()]).to_vec(),
            cells: arrays.grid_cells.download().expect("cells"),
            entries: arrays.leaf_triangles.download().expect("entries"),
            planes: arrays.leaf_planes.download().expect("planes"),
        }
    }

    /// Compares a geometry's grid with the host's.
    fn check(&self, ix: usize, grid: &Grid, triangles: &[Triangle]) -> Result<(), String> {
        let (found, own) = (self.constants[ix], grid.constants());
        let expected = GeometryConstants {
            box_min: own.box_min,
            plane_epsilon: own.plane_epsilon,
            box_max: own.box_max,
            origin_reach: own.origin_reach,
            n_cells_x: own.n_cells_x,
            n_cells_y: own.n_cells_y,
            n_cells_z: own.n_cells_z,
            cell_size: own.cell_size,
            ..found
        };
        compare::exact(&[expected], &[found]).map_err(|what| format!("constants: {what}"))?;
        let cells = &self.cells[found.first_cell as usize..][..grid.cells().len()];
        let n_blocks = if grid.n_levels() == 2 { grid.lattice().n_cubes() } else { 0 };
        let first_entry = cells[n_blocks].first - grid.cells()[n_blocks].first;
        let moved = |(cell_ix, cell): (usize, &GridCell)| {
            let by = if cell_ix < n_blocks { found.first_cell } else { first_entry };
            GridCell { first: cell.first + by, count: cell.count }
        };
        let expected: Vec<_> = grid.cells().iter().enumerate().map(moved).collect();
        compare::exact(&expected, cells).map_err(|what| format!("cells: {what}"))?;
        let entry = |&triangle_ix: &u32| {
            let Triangle { v0, v1, v2, .. } = triangles[triangle_ix as usize];
            LeafTriangle { v0, triangle_ix: found.first_row + triangle_ix, v1, v2, ..LeafTriangle::default() }
        };
        let expected: Vec<_> = grid.leaf_triangles().iter().map(entry).collect();
        let entries = first_entry as usize..first_entry as usize + expected.len();
        compare::exact(&expected, &self.entries[entries.clone()]).map_err(|what| format!("entries: {what}"))?;
        compare::exact(grid.leaf_planes(), &self.planes[entries]).map_err(|what| format!("planes: {what}"))
    }
}

/// Checks that the arrays of a renderer have the host's grids of its world's geometries, if the world has grids.
pub(super) fn check_grids(name: &str, renderer: &GpuRenderer, world: &World) {
    let AccelOptions::Grid(options) = world.accel_options() else { return };
    let arrays = Arrays::of(&renderer.resources().accel.arrays, world);
    let instances = world.scene().instances.as_ref().expect("instances");
    for (ix, range) in instances.ranges.iter().enumerate() {
        let triangles = range.of(&world.scene().triangles);
        let check = arrays.check(ix, &Grid::build(triangles, options), triangles);
        check.unwrap_or_else(|what| panic!("{name}: geometry {ix}: {what}"));
    }
}

#[test]
fn a_film_has_the_hosts_grids_in_each_moment() {
    let context = device();
    for options in &lazy_options()[1..] {
        let mut scene = scene();
        let mut world = lazy_of(&scene, options);
        let mut film = renderer(&context, &world, Integrator::Whitted);
        check_grids("first moment", &film, &world);
        for moment in 1..4 {
            world = next_moment(&mut scene, &world, moment);
            film.set_world(&world).expect("a change");
            check_grids(&format!("moment {moment}"), &film, &world);
        }
    }
    assert_silent(&context);
}

#[test]
fn statistics_are_those_of_the_hosts_grids() {
    let context = device();
    for options in &lazy_options()[1..] {
        let [found, expected] = [(); 2].map(|()| lazy_of(&scene(), options));
        let film = renderer(&context, &found, Integrator::Whitted);
        assert!(found.device_build().is_some() && expected.device_build().is_none());
        assert_eq!(found.statistics(), expected.statistics());
        drop(film);
    }
}

/// The device cannot bind the triangles of the largest mesh.
#[test]
fn without_room_the_host_builds_the_grids() {
    let scene = scene();
    let narrow = pretended(DeviceOverrides { storage_range: Some(3 << 16), ..DeviceOverrides::default() });
    for options in &lazy_options()[1..] {
        let world = lazy_of(&scene, options);
        let mut film = renderer(&narrow, &world, Integrator::Whitted);
        assert_eq!(world.device_build(), None);
        let expected = drawn(&mut renderer(&device(), &kept(&scene), Integrator::Whitted));
        assert!(drawn(&mut film).radiance == expected.radiance);
    }
    assert_silent(&narrow);
}

#[test]
fn one_changed_number_is_noticed() {
    let context = device();
    let world = lazy_of(&scene(), &lazy_options()[2]);
    let AccelOptions::Grid(options) = world.accel_options() else { panic!("grids") };
    let film = renderer(&context, &world, Integrator::Whitted);
    let range = world.scene().instances.as_ref().expect("instances").ranges[0];
    let triangles = range.of(&world.scene().triangles);
    let grid = Grid::build(triangles, options);
    let check = |plant: fn(&mut Arrays, usize)| {
        let mut arrays = Arrays::of(&film.resources().accel.arrays, &world);
        let first = arrays.constants[0].first_cell as usize;
        plant(&mut arrays, first);
        arrays.check(0, &grid, triangles)
    };
    assert_eq!(check(|_, _| {}), Ok(()));
    let plants: [fn(&mut Arrays, usize); 5] = [
        |arrays, _| arrays.constants[0].cell_size *= 1.5,
        |arrays, first| arrays.cells[first + 2].first += 1,
        |arrays, first| arrays.cells[first + 5].count += 1,
        |arrays, _| arrays.entries.iter_mut().for_each(|entry| entry.triangle_ix += 1),
        |arrays, _| arrays.planes.iter_mut().for_each(|plane| plane.distance += 1.0),
    ];
    for (ix, plant) in plants.into_iter().enumerate() {
        assert!(check(plant).is_err(), "plant {ix}");
    }
}

/// If an update of two meshes fails between them, one is of the next moment. Its lattice is, too, also in the rows that
/// the renderer had before.
#[test]
fn after_a_failure_each_grid_has_its_own_lattice() {
    let context = device();
    let mut scene = scene();
    let first = lazy_of(&scene, &lazy_options()[2]);
    let AccelOptions::Grid(options) = first.accel_options() else { panic!("grids") };
    let mut film = renderer(&context, &first, Integrator::Whitted);
    let mut world = next_moment(&mut scene, &first, 1);
    film.set_world(&world).expect("a change"); // makes the builder
    let (mut n_half, mut is_done) = (0, false);
    for n in 0.. {
        if is_done {
            break;
        }
        let before = world.clone();
        world = next_moment(&mut scene, &world, 2 * u64::from(n) + 2);
        context.fail_creations_after(Some(n));
        is_done = film.set_world(&world).is_ok();
        context.fail_creations_after(None);
        let arrays = Arrays::of(&film.resources().accel.arrays, &world);
        let of = |world: &World, ix: usize| {
            let range = world.scene().instances.as_ref().expect("instances").ranges[ix];
            let triangles = range.of(&world.scene().triangles);
            arrays.check(ix, &Grid::build(triangles, options), triangles)
        };
        let are_new = [0, 1].map(|ix| of(&world, ix).is_ok());
        for ix in [0, 1] {
            assert!(are_new[ix] || of(&before, ix).is_ok(), "after {n} creations, {ix}: {:?}", of(&world, ix));
        }
        n_half += usize::from(are_new[0] != are_new[1]);
        film.set_world(&world).expect("a change");
    }
    assert!(n_half > 0, "an update failed between the meshes");
    assert_silent(&context);
}
