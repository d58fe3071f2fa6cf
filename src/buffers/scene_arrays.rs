//! The arrays of the scene on a device, as glsl/shared/scene_arrays.glsl lists them, and how kernels read them.

use std::sync::Arc;

use bytemuck::Pod;

use crate::{
    gpu::{AnyBuffer, Binding, Buffer, BufferUse, Context, GpuError, texel_bytes},
    layout::{
        AccelConstants, BIND_TEXELS, GridCell, KdBox, KdNode, KdRope, LeafTriangle, Plane, READING_ADDRESS,
        READING_BOUND, READING_TEXELS, Slab, Triangle, for_scene_arrays,
    },
};

/// How kernels read the scene's arrays (glsl/shared/scene.glsl). All arrays are read in the same way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneAccess {
    /// As storage buffers that are bound.
    Bound,
    /// As texels: on software drivers, if no array has more texels than the device allows for.
    Texels,
    /// By device address, if an array is larger than what the device binds.
    Address,
}

impl SceneAccess {
    /// The fastest way that the device has for arrays of these sizes.
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

    /// The use of a buffer that is read so.
    fn buffer_use(self) -> BufferUse {
        if self == Self::Address { BufferUse::Address } else { BufferUse::Texels }
    }
}

/// What an array of `T` holds when it is made.
pub enum Content<'a, T> {
    /// These elements, which are uploaded.
    Elements(&'a [T]),
    /// So many elements, which `write(first, part)` makes in parts: those from element `first` on.
    Written { len: usize, write: &'a dyn Fn(usize, &mut [T]) },
    /// The elements of a buffer, which must be for [`BufferUse::Texels`].
    OnDevice(Buffer<T>),
    /// Nothing. Later the array may be replaced by one of up to so many elements.
    Reserved(usize),
}

/// What an array takes, or may take later.
struct Size {
    bytes: u64,
    n_texels: u64,
}

impl<T: Pod> Content<'_, T> {
    fn size(&self) -> Size {
        let len = match self {
            Self::Elements(elements) => elements.len(),
            Self::Written { len, .. } | Self::Reserved(len) => *len,
            Self::OnDevice(buffer) => buffer.len(),
        };
        let bytes = (len * size_of::<T>()) as u64;
        Size { bytes, n_texels: bytes / texel_bytes::<T>() }
    }

    /// Makes the array.
    ///
    /// # Errors
    /// Beyond the device's limits, out of memory.
    pub fn upload(self, context: &Arc<Context>, name: &str, access: SceneAccess) -> Result<Buffer<T>, GpuError> {
        let usage = access.buffer_use();
        match self {
            Self::Elements(elements) => Buffer::with(context, name, elements, usage),
            Self::Written { len, write } => Buffer::written_by(context, name, len, usage, write),
            Self::OnDevice(buffer) => {
                assert_eq!(usage, BufferUse::Texels, "what was made on the device is not read by address");
                Ok(buffer)
            }
            Self::Reserved(_) => Buffer::new(context, name, 0, usage),
        }
    }
}

macro_rules! declare {
    ($($(#[doc = $doc:literal])* $name:ident: $element:ty = $number:literal,)*) => {
        /// The scene's arrays. A clone is a second handle to the same buffers.
        #[derive(Clone)]
        pub struct SceneArrays {
            $($(#[doc = $doc])* pub $name: Buffer<$element>,)*
        }

        /// What each of the scene's arrays holds when it is made.
        pub struct Contents<'a> {
            $($(#[doc = $doc])* pub $name: Content<'a, $element>,)*
        }

        /// The numbers of the arrays' bindings.
        const NUMBERS: &[u32] = &[$($number),*];

        impl<'a> Contents<'a> {
            /// Triangles, room for their materials, and no structure.
            pub fn of_triangles(triangles: &'a [Triangle]) -> Self {
                Self {
                    triangles: Content::Elements(triangles),
                    triangle_materials: Content::Reserved(triangles.len()),
                    ..Self { $($name: Content::Reserved(0),)* }
                }
            }

            fn sizes(&self) -> [Size; NUMBERS.len()] {
                [$(self.$name.size()),*]
            }

            /// Makes all arrays.
            ///
            /// # Errors
            /// Beyond the device's limits, out of memory.
            pub fn upload(self, context: &Arc<Context>, access: SceneAccess) -> Result<SceneArrays, GpuError> {
                Ok(SceneArrays { $($name: self.$name.upload(context, stringify!($name), access)?,)* })
            }
        }

        impl SceneArrays {
            /// In the order of `NUMBERS`.
            fn buffers(&self) -> [&AnyBuffer; NUMBERS.len()] {
                [$(self.$name.any()),*]
            }

            /// Sets the addresses of the arrays, of which all must be for [`SceneAccess::Address`].
            pub fn write_addresses(&self, constants: &mut AccelConstants) {
                $(constants.$name = self.$name.address();)*
            }
        }
    };
}

for_scene_arrays!(declare);

impl SceneArrays {
    /// The bindings of the arrays, as [`SceneArrays::objects`] has them.
    pub fn bindings() -> impl Iterator<Item = u32> {
        NUMBERS.iter().copied().chain(NUMBERS.iter().map(|number| BIND_TEXELS + number))
    }

    /// What the bindings hold: each array as a buffer and as texels.
    pub fn objects(&self) -> impl Iterator<Item = (u32, Binding<'_>)> {
        let arrays = NUMBERS.iter().copied().zip(self.buffers());
        let bound = arrays.clone().map(|(number, buffer)| (number, Binding::Buffer(buffer)));
        let texels = arrays.map(|(number, buffer)| (BIND_TEXELS + number, Binding::Texels(buffer)));
        bound.chain(texels)
    }
}
