//! Tests that a device builds the same grid as the host, bit for bit.

mod support;

use std::sync::Arc;

use glam::{Vec3, vec3};
use kdray::{
    accel::grid::{Grid, GridLevels, GridOptions},
    gpu::{Buffer, BufferUse, Context, DeviceOverrides, Timer},
    layout::{
        GRID_BLOCK_SIZE, GRID_GROUPS_X, GRID_MAX_SORT_GROUPS, GridCell, LeafTriangle, Plane, StructurePlace, Triangle,
    },
    passes::grid::{BuiltGrid, GridBuilder},
};
use support::{assert_silent, device, meshes, random::Random};

/// Returns the options of both kinds of grids, each with its name.
fn kinds() -> [(&'static str, GridOptions); 2] {
    [("uniform", GridOptions::uniform()), ("two levels", GridOptions::two_level())]
}

/// The content of a grid, by which two grids are compared.
#[derive(Clone, Debug, PartialEq)]
struct Content {
    /// Bits of the lattice's corners and of the cells' size.
    lattice: [u32; 7],
    n_cells: [u32; 3],
    n_coarser: u32,
    cells: Vec<GridCell>,
    leaf_triangles: Vec<[u32; 12]>,
    leaf_planes: Vec<[u32; 4]>,
}

fn plane_bits(plane: &Plane) -> [u32; 4] {
    [plane.normal.x, plane.normal.y, plane.normal.z, plane.distance].map(f32::to_bits)
}

fn lattice_bits(lattice: &kdray::accel::grid::Lattice) -> [u32; 7] {
    let [[a, b, c], [d, e, f]] = [lattice.min, lattice.max];
    [a, b, c, d, e, f, lattice.cell_size].map(f32::to_bits)
}

impl Content {
    fn of_host(triangles: &[Triangle], grid: &Grid) -> Self {
        let leaf_triangle = |&triangle_ix: &u32| {
            let Triangle { v0, v1, v2, .. } = triangles[triangle_ix as usize];
            bytemuck::cast(LeafTriangle { v0, triangle_ix, v1, v2, ..LeafTriangle::default() })
        };
        Self {
            lattice: lattice_bits(grid.lattice()),
            n_cells: grid.lattice().n_cells,
            n_coarser: grid.statistics().n_coarser,
            cells: grid.cells().to_vec(),
            leaf_triangles: grid.leaf_triangles().iter().map(leaf_triangle).collect(),
            leaf_planes: grid.leaf_planes().iter().map(plane_bits).collect(),
        }
    }

    fn of_device(builder: &GridBuilder, built: &BuiltGrid) -> Self {
        let arrays = builder.copy(built, BufferUse::Texels).expect("arrays");
        let leaf_triangles = arrays.leaf_triangles.download().expect("leaf_triangles");
        Self {
            lattice: lattice_bits(&built.lattice),
            n_cells: built.lattice.n_cells,
            n_coarser: built.n_coarser,
            cells: arrays.cells.download().expect("cells"),
            leaf_triangles: leaf_triangles.into_iter().map(bytemuck::cast).collect(),
            leaf_planes: arrays.leaf_planes.download().expect("leaf_planes").iter().map(plane_bits).collect(),
        }
    }

    /// Describes the first difference, if there is one.
    fn difference(&self, found: &Self) -> Option<String> {
        fn first<T: PartialEq + std::fmt::Debug>(name: &str, expected: &[T], found: &[T]) -> Option<String> {
            if expected.len() != found.len() {
                return Some(format!("{} {name}, not {}", found.len(), expected.len()));
            }
            let n = expected.iter().zip(found).filter(|(a, b)| a != b).count();
            let i = expected.iter().zip(found).position(|(a, b)| a != b)?;
            Some(format!("{n} of {} {name}; {i}: {:?}, not {:?}", found.len(), found[i], expected[i]))
        }
        first("lattices", &[self.lattice], &[found.lattice])
            .or_else(|| first("resolutions", &[self.n_cells], &[found.n_cells]))
            .or_else(|| first("n_coarser", &[self.n_coarser], &[found.n_coarser]))
            .or_else(|| first("cells", &self.cells, &found.cells))
            .or_else(|| first("leaf_triangles", &self.leaf_triangles, &found.leaf_triangles))
            .or_else(|| first("leaf_planes", &self.leaf_planes, &found.leaf_planes))
    }
}

/// Asserts that the device builds the host's grid, which it returns.
fn check(context: &Arc<Context>, name: &str, triangles: &[Triangle], options: &GridOptions) -> Grid {
    let buffer = Buffer::with(context, "triangles", triangles, BufferUse::Storage).expect("triangles");
    let builder = GridBuilder::new(context, &buffer, options).expect("a builder");
    let expected = Grid::build(triangles, builder.options());
    let found = builder.build(None).expect("a grid");
    let difference = Content::of_host(triangles, &expected).difference(&Content::of_device(&builder, &found));
    assert_eq!(difference, None, "{name}, {:?}, {:?}", options.levels, expected.statistics());
    expected
}

fn check_both(context: &Arc<Context>, name: &str, triangles: &[Triangle]) {
    for (_, options) in kinds() {
        check(context, name, triangles, &options);
    }
}

/// Returns a soup of triangles that are each about as long as the whole soup.
fn long_soup(n: usize) -> Vec<Triangle> {
    let lengthened = |triangle: Triangle| Triangle { v1: triangle.v0 + 30.0 * (triangle.v1 - triangle.v0), ..triangle };
    meshes::soup(n, 5).into_iter().map(lengthened).collect()
}

#[test]
fn small_meshes_have_the_hosts_grid() {
    let context = device();
    let torus = || meshes::torus(40, 20);
    check_both(&context, "none", &[]);
    check_both(&context, "one", &[meshes::triangle(Vec3::X, Vec3::Y, Vec3::Z)]);
    check_both(&context, "torus", &torus());
    check_both(&context, "cube", &meshes::cube(9, 0.0));
    check_both(&context, "sphere", &meshes::cube(10, 1.0));
    check_both(&context, "soup", &meshes::soup(1200, 7));
    check_both(&context, "tiny", &meshes::placed(torus(), 1e-6, Vec3::ZERO));
    check_both(&context, "huge", &meshes::placed(torus(), 1e6, Vec3::ZERO));
    check_both(&context, "far", &meshes::placed(torus(), 0.3, vec3(1000.0, -70.0, 3.0)));
    check_both(&context, "farther", &meshes::placed(torus(), 10.0, vec3(1e5, -1e5, 3.0)));
    assert_silent(&context);
}

#[test]
fn degenerate_triangles_have_the_hosts_grid() {
    let context = device();
    let [a, b] = [vec3(0.1, 0.2, 0.3), vec3(-1.0, 2.0, 0.5)];
    check_both(&context, "points", &[meshes::triangle(a, a, a); 300]);
    check_both(&context, "segments", &[meshes::triangle(a, b, a.lerp(b, 0.3)); 300]);
    check_both(&context, "origin", &[meshes::triangle(Vec3::ZERO, Vec3::ZERO, -Vec3::ZERO)]);
    check_both(&context, "flat", &[meshes::triangle(Vec3::ZERO, Vec3::X, Vec3::Y); 3]);
    let mut holed = meshes::torus(30, 20);
    holed[7].v0.x = f32::NAN;
    holed[500].v1.y = f32::INFINITY;
    holed[1199].v2.z = f32::NEG_INFINITY;
    check_both(&context, "holed", &holed);
    holed.iter_mut().for_each(|triangle| triangle.v1.x = f32::NAN);
    check_both(&context, "nothing finite", &holed);
    assert_silent(&context);
}

#[test]
fn numbers_of_triangles_around_a_block_have_the_hosts_grid() {
    let context = device();
    let soup = meshes::soup(3 * GRID_BLOCK_SIZE as usize, 3);
    for n in [127, 128, 129, GRID_BLOCK_SIZE - 1, GRID_BLOCK_SIZE, GRID_BLOCK_SIZE + 1, 2 * GRID_BLOCK_SIZE + 1] {
        check_both(&context, &format!("{n}"), &soup[..n as usize]);
    }
    assert_silent(&context);
}

#[test]
fn coincident_triangles_have_the_hosts_grid() {
    let context = device();
    let corners = [vec3(0.1, 0.2, 0.3), vec3(0.11, 0.2, 0.3), vec3(0.1, 0.21, 0.32)];
    let [a, b, c] = corners;
    let mut triangles = vec![meshes::triangle(a, b, c); 5000];
    triangles.extend(meshes::torus(20, 10));
    check_both(&context, "coincident", &triangles);
    assert_silent(&context);
}

/// The limit of references is exceeded, so the build tries larger and larger cells, up to a single cell.
#[test]
fn triangles_above_the_limit_have_the_hosts_grid() {
    let context = device();
    let triangles = long_soup(3000);
    for (kind, options) in kinds() {
        let mut found = Vec::new();
        for max_references_per_triangle in [8, 5, 3, 2, 1, 0] {
            let limited = GridOptions { max_references_per_triangle, ..options.clone() };
            let statistics = check(&context, "long", &triangles, &limited).statistics();
            assert!(statistics.n_references <= u64::from(max_references_per_triangle) * 3000 + 3000, "{statistics:?}");
            found.push(statistics.n_coarser);
        }
        assert!(found.is_sorted() && found[0] < found[5], "{kind}: {found:?}");
    }
    assert_silent(&context);
}

/// The mesh is large enough for several rows of workgroups, and for several blocks per workgroup of the sort.
#[test]
fn many_triangles_have_the_hosts_grid() {
    let context = device();
    let triangles = meshes::torus(720, 180);
    let fine = [GridLevels::Uniform { density: 16.0 }, GridLevels::Two { upper_density: 0.5, lower_density: 2.0 }];
    for ((kind, options), levels) in kinds().into_iter().zip(fine) {
        let options = GridOptions { levels, ..options };
        let statistics = check(&context, "many", &triangles, &options).statistics();
        let n_blocks = statistics.n_references.div_ceil(GRID_BLOCK_SIZE.into());
        assert!(n_blocks > GRID_MAX_SORT_GROUPS.max(GRID_GROUPS_X).into(), "{kind}: {statistics:?}");
    }
    assert_silent(&context);
}

/// A device that binds little memory gets larger cells, and an error if it cannot bind the triangles.
#[test]
fn what_a_device_binds_is_a_limit() {
    let n = 2000;
    let of_range = |storage_range| {
        support::pretended(DeviceOverrides { storage_range: Some(storage_range), ..DeviceOverrides::default() })
    };
    let triangles = long_soup(n);
    let context = of_range(2 * n as u64 * size_of::<LeafTriangle>() as u64);
    for (kind, options) in kinds() {
        let statistics = check(&context, "limited", &triangles, &options).statistics();
        assert!(statistics.n_coarser > 0 && statistics.n_references <= 2 * n as u64, "{kind}: {statistics:?}");
    }
    let context = of_range(size_of::<Triangle>() as u64 * (n as u64 - 1));
    let buffer = Buffer::with(&context, "triangles", &triangles, BufferUse::Texels).expect("triangles");
    let error = GridBuilder::new(&context, &buffer, &GridOptions::uniform()).err().expect("an error").to_string();
    assert!(error.starts_with("`triangles` takes 0.1 MiB, more than this device's limit"), "{error}");
    assert_silent(&context);
}

#[test]
fn the_same_build_twice_gives_the_same_bits() {
    let context = device();
    let triangles = meshes::soup(4000, 11);
    let buffer = Buffer::with(&context, "triangles", &triangles, BufferUse::Storage).expect("triangles");
    for (kind, options) in kinds() {
        let builder = GridBuilder::new(&context, &buffer, &options).expect("a builder");
        let build = || Content::of_device(&builder, &builder.build(None).expect("a grid"));
        assert_eq!(build().difference(&build()), None, "{kind}");
    }
    assert_silent(&context);
}

#[test]
fn relocated_grids_have_the_indices_of_their_places() {
    let context = device();
    for (n, (kind, options)) in
        [1, GRID_BLOCK_SIZE as usize / 3, 3000].into_iter().flat_map(|n| kinds().map(|it| (n, it)))
    {
        let triangles = meshes::soup(n, 4);
        // There is room for more triangles than the grid has.
        let buffer = Buffer::with(&context, "triangles", &meshes::soup(n + 500, 9), BufferUse::Storage).expect("room");
        buffer.upload(&triangles).expect("triangles");
        let builder = GridBuilder::new(&context, &buffer, &options).expect("a builder");
        let grid = Grid::build(&triangles, builder.options());
        let mut expected = Content::of_host(&triangles, &grid);
        let built = builder.build_first(n, None).expect("a grid");
        assert_eq!(expected.difference(&Content::of_device(&builder, &built)), None, "{kind}, {n} triangles");
        let n_blocks = if grid.n_levels() == 2 { grid.lattice().n_cubes() } else { 0 };
        let (blocks, lowest) = expected.cells.split_at_mut(n_blocks);
        blocks.iter_mut().for_each(|cell| cell.first += 14);
        lowest.iter_mut().for_each(|cell| cell.first += 1001);
        expected.leaf_triangles.iter_mut().for_each(|entry| entry[3] += 77);
        let place = StructurePlace { first_element: 14, first_entry: 1001, first_row: 77 };
        builder.copy_relocated(&built, &place, BufferUse::Storage).expect("a copy");
        assert_eq!(
            expected.difference(&Content::of_device(&builder, &built)),
            None,
            "{kind}, {n} triangles, relocated"
        );
    }
    assert_silent(&context);
}

#[test]
#[should_panic(expected = "4 triangles, room for 3")]
fn more_triangles_than_there_is_room_for_are_refused() {
    let context = device();
    let buffer = Buffer::with(&context, "triangles", &meshes::soup(3, 1), BufferUse::Storage).expect("triangles");
    let _ = GridBuilder::new(&context, &buffer, &GridOptions::uniform()).expect("a builder").build_first(4, None);
}

#[test]
fn one_changed_number_is_noticed() {
    let mut random = Random(3);
    let triangles = meshes::torus(20, 10);
    for (kind, options) in kinds() {
        let content = Content::of_host(&triangles, &Grid::build(&triangles, &options));
        assert_eq!(content.difference(&content.clone()), None);
        type Plant = dyn Fn(&mut Content, usize);
        let plants: [&Plant; 6] = [
            &|content, i| content.lattice[i % 7] ^= 1,
            &|content, _| content.n_coarser += 1,
            &|content, i| content.cells[i % 500].first ^= 1,
            &|content, i| content.cells[i % 500].count += 1,
            &|content, i| content.leaf_triangles[i % 500][i % 12] ^= 1,
            &|content, i| content.leaf_planes[i % 500][i % 4] ^= 1,
        ];
        for plant in plants {
            let mut planted = content.clone();
            plant(&mut planted, random.below(12_000));
            assert!(content.difference(&planted).is_some(), "{kind}");
        }
    }
}

#[test]
fn each_stage_has_its_row() {
    let context = device();
    let triangles = meshes::torus(20, 10);
    let buffer = Buffer::with(&context, "triangles", &triangles, BufferUse::Storage).expect("triangles");
    for (kind, options) in kinds() {
        let builder = GridBuilder::new(&context, &buffer, &options).expect("a builder");
        let timer = Timer::new(&context, builder.n_stages()).expect("a timer");
        let grid = builder.build(Some(&timer)).expect("a grid");
        assert_eq!(grid.stages.len(), builder.n_stages() as usize, "{kind}");
        assert!(grid.stages.iter().all(|row| row.name.starts_with("grid_")));
    }
    assert_silent(&context);
}
