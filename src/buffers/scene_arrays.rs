//! Arrays of the scene on a device, as glsl/shared/scene_arrays.glsl lists them, and the way in which kernels read
//! them.

use std::sync::Arc;

use bytemuck::Pod;

use crate::{
    gpu::{AnyBuffer, Binding, Buffer, BufferUse, Context, GpuError, texel_bytes},
    layout::{
        AccelConstants, BIND_TEXELS, GridCell, InstanceRow, KdNode, KdRope, LeafTriangle, Plane, READING_ADDRESS,
        READING_BOUND, READING_TEXELS, Slab, Triangle, for_scene_arrays,
    },
};

/// Way in which kernels read the scene's arrays (glsl/shared/scene.glsl). It is the same for all arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneAccess {
    /// Kernels read bound storage buffers.
    Bound,
    /// Kernels read texels. It is for software drivers, if no array has more texels than the device allows.
    Texels,
    /// Kernels read device addresses. It is for scenes with an array that is larger than the device can bind.
    Address,
}

impl SceneAccess {
    /// Returns the fastest way that the device has for arrays of these sizes.
    pub fn of(context: &Context, contents: &Contents) -> Self {
        let (limits, sizes) = (context.limits(), contents.sizes());
        if context.predicates_branches() && sizes.iter().all(|size| size.n_texels <= u64::from(limits.n_texels)) {
            Self::Texels
        } else if sizes.iter().all(|size| size.bytes <= limits.storage_range) {
            Self::Bound
        } else {
            Self::Address
        }
    }

    /// The value of the kernels' constant `READING`.
    pub fn constant(self) -> u32 {
        match self {
            Self::Bound => READING_BOUND,
            Self::Texels => READING_TEXELS,
            Self::Address => READING_ADDRESS,
        }
    }

    /// The use of buffers that are read in this way.
    pub fn buffer_use(self) -> BufferUse {
        if self == Self::Address { BufferUse::Address } else { BufferUse::Texels }
    }
}

/// Contents of an array of `T` when it is made.
pub enum Content<'a, T> {
    /// Elements that are uploaded.
    Elements(&'a [T]),
    /// `len` elements, which `write(first, chunk)` makes in chunks: `chunk` is the elements from `first` on.
    Written { len: usize, write: &'a dyn Fn(usize, &mut [T]) },
    /// The elements of a buffer, and what it has been made for: [`SceneAccess::buffer_use`] of the scene.
    OnDevice(Buffer<T>, BufferUse),
    /// No elements. Later the array may be replaced by one of up to this many elements.
    Reserved(usize),
}

/// Size of an array, or the size that it may have later.
struct Size {
    bytes: u64,
    n_texels: u64,
}

impl<T: Pod> Content<'_, T> {
    fn size(&self) -> Size {
        let len = match self {
            Self::Elements(elements) => elements.len(),
            Self::Written { len, .. } | Self::Reserved(len) => *len,
            Self::OnDevice(buffer, _) => buffer.len(),
        };
        let bytes = (len * size_of::<T>()) as u64;
        Size { bytes, n_texels: bytes / texel_bytes::<T>() }
    }

    /// Makes the array. `name`: its debug label.
    ///
    /// # Errors
    /// A buffer is beyond the device's limits, or memory runs out.
    pub fn upload(self, context: &Arc<Context>, name: &str, access: SceneAccess) -> Result<Buffer<T>, GpuError> {
        let usage = access.buffer_use();
        match self {
            Self::Elements(elements) => Buffer::with(context, name, elements, usage),
            Self::Written { len, write } => Buffer::written_by(context, name, len, usage, write),
            Self::OnDevice(buffer, made_for) => {
                assert_eq!(usage, made_for, "what was made on the device is read as it was made for");
                Ok(buffer)
            }
            Self::Reserved(_) => Buffer::new(context, name, 0, usage),
        }
    }
}

macro_rules! declare {
    ($($(#[doc = $doc:literal])* $name:ident: $element:ty = $number:literal,)*) => {
        /// Buffers of the scene's arrays. A clone is a second handle to the same buffers.
        #[derive(Clone)]
        pub struct SceneArrays {
            $($(#[doc = $doc])* pub $name: Buffer<$element>,)*
        }

        /// Contents of each of the scene's arrays when it is made.
        pub struct Contents<'a> {
            $($(#[doc = $doc])* pub $name: Content<'a, $element>,)*
        }

        /// The numbers of the arrays' bindings.
        const NUMBERS: &[u32] = &[$($number),*];

        impl<'a> Contents<'a> {
            /// Returns the contents of a scene that has triangles, room for their materials and textures, and no
            /// acceleration structure.
            pub fn of_triangles(triangles: &'a [Triangle], n_texture_words: usize) -> Self {
                Self {
                    triangles: Content::Elements(triangles),
                    triangle_materials: Content::Reserved(triangles.len()),
                    texture_words: Content::Reserved(n_texture_words),
                    ..Self { $($name: Content::Reserved(0),)* }
                }
            }

            fn sizes(&self) -> [Size; NUMBERS.len()] {
                [$(self.$name.size()),*]
            }

            /// Makes all arrays.
            ///
            /// # Errors
            /// A buffer is beyond the device's limits, or memory runs out.
            pub fn upload(self, context: &Arc<Context>, access: SceneAccess) -> Result<SceneArrays, GpuError> {
                Ok(SceneArrays { $($name: self.$name.upload(context, stringify!($name), access)?,)* })
            }
        }

        impl SceneArrays {
            /// Returns the buffers in the order of `NUMBERS`.
            fn buffers(&self) -> [&Arc<AnyBuffer>; NUMBERS.len()] {
                [$(self.$name.any()),*]
            }

            /// Writes the arrays' addresses into the constants. All arrays must have been made for
            /// [`SceneAccess::Address`].
            pub fn write_addresses(&self, constants: &mut AccelConstants) {
                $(constants.$name = self.$name.address();)*
            }
        }
    };
}

for_scene_arrays!(declare);

impl SceneArrays {
    /// Returns the bindings of the arrays, in the order of [`SceneArrays::objects`].
    pub fn bindings() -> impl Iterator<Item = u32> {
        NUMBERS.iter().copied().chain(NUMBERS.iter().map(|number| BIND_TEXELS + number))
    }

    /// Returns the objects that the bindings are bound to: each array as a buffer and as texels.
    pub fn objects(&self) -> impl Iterator<Item = (u32, Binding<'_>)> {
        let arrays = NUMBERS.iter().copied().zip(self.buffers());
        let bound = arrays.clone().map(|(number, buffer)| (number, Binding::Buffer(buffer)));
        let texels = arrays.map(|(number, buffer)| (BIND_TEXELS + number, Binding::Texels(buffer)));
        bound.chain(texels)
    }
}
