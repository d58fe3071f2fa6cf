//! The geometries of a world, and the arrays of the scene into which their triangles and structures go.

use std::{borrow::Cow, sync::Arc};

use bytemuck::cast_slice;

use super::scene_arrays::SceneArrays;
use crate::{
    accel::{
        bottom_level::{BottomLevel, LazyStructure},
        two_level::TwoLevel,
    },
    gpu::{AnyBuffer, Buffer},
    layout::{CornerSurface, InstanceRow, Triangle},
    passes::structures::{BufferCopy, Source, StructureArrays},
    util::Shared,
    world::{Geometry, Instances, Poses},
};

/// The geometries of a world, and their triangles.
#[derive(Clone, Copy)]
pub struct Geometries<'a> {
    pub two: &'a TwoLevel,
    pub instances: &'a Instances,
    /// All of them. Their triangles are made where they are first asked for.
    pub geometry: Geometry<'a>,
    /// The poses of those geometries whose triangles the device computes.
    pub poses: &'a Poses,
}

impl<'a> Geometries<'a> {
    pub fn structure(&self, ix: usize) -> &'a Arc<BottomLevel> {
        &self.two.structures()[ix]
    }

    pub fn triangles(&self, ix: usize) -> Cow<'a, [Triangle]> {
        match self.poses.get(ix) {
            Some(posed) => posed.triangles().into(),
            None => self.instances.ranges[ix].of(self.geometry.triangles()).into(),
        }
    }

    pub fn lazy(&self) -> impl Iterator<Item = (usize, LazyStructure<'a>)> {
        self.two.structures().iter().enumerate().filter_map(|(ix, it)| Some((ix, it.as_lazy()?)))
    }

    /// The host's structures among those with these indices.
    pub fn of_host(&self, ixs: impl IntoIterator<Item = usize>) -> Vec<(usize, &'a BottomLevel)> {
        let all = ixs.into_iter().map(|ix| (ix, &**self.structure(ix)));
        all.filter(|(_, structure)| structure.as_lazy().is_none()).collect()
    }
}

/// The scene's arrays, and what textures need at the corners of all stored triangles.
pub struct Arrays<'a> {
    pub arrays: &'a SceneArrays,
    /// The `instance_rows` of the world before.
    pub rows_before: &'a Buffer<InstanceRow>,
    /// Where the rows of geometries begin, in these `instance_rows` as in those before.
    pub geometries_begin: usize,
    /// Tangents and colours; none if the scene has none.
    pub corners: Option<&'a Shared<Vec<[CornerSurface; 3]>>>,
    /// Where the corners are in `texture_words`.
    pub corners_begin: usize,
}

impl Arrays<'_> {
    /// Returns the arrays that hold structures.
    pub fn structures(&self) -> StructureArrays {
        StructureArrays {
            nodes: self.arrays.kd_nodes.clone(),
            parents: self.arrays.kd_parents.clone(),
            leaf_triangles: self.arrays.leaf_triangles.clone(),
            leaf_planes: self.arrays.leaf_planes.clone(),
            slabs: self.arrays.kd_slabs.clone(),
            cells: self.arrays.grid_cells.clone(),
        }
    }

    /// The number of words of a triangle's corners.
    pub fn n_corner_words(&self) -> usize {
        self.corners.map_or(0, |_| size_of::<[CornerSurface; 3]>() / size_of::<u32>())
    }

    /// The words of the corners of some triangles.
    pub fn corners_of(&self, first_row: usize, n_triangles: usize) -> &[u32] {
        self.corners.map_or(&[], |corners| cast_slice(&corners[first_row..][..n_triangles]))
    }

    /// The place of the first corner of a triangle in `texture_words`.
    pub fn first_word(&self, row: usize) -> usize {
        self.corners_begin + row * self.n_corner_words()
    }

    /// Returns the copies of a geometry's first triangles, and of the words of their corners, to their places.
    pub fn copies(
        &self,
        (triangles, n_triangles): (&Buffer<Triangle>, usize),
        (corners, n_words): (&Buffer<u32>, usize),
        first_row: usize,
    ) -> Vec<BufferCopy> {
        let copy = |from: &Arc<AnyBuffer>, to: &Arc<AnyBuffer>, begin: usize, bytes: usize| BufferCopy {
            from: Source::Buffer(from.clone(), bytes),
            to: (to.clone(), begin),
        };
        let bytes_of = |n_triangles: usize| n_triangles * size_of::<Triangle>();
        vec![
            copy(triangles.any(), self.arrays.triangles.any(), bytes_of(first_row), bytes_of(n_triangles)),
            copy(
                corners.any(),
                self.arrays.texture_words.any(),
                self.first_word(first_row) * size_of::<u32>(),
                n_words * size_of::<u32>(),
            ),
        ]
    }
}
