//! Compiles `glsl/{passes,probes,driver}/*` to SPIR-V, and turns `glsl/shared/{layout,scene_arrays}.glsl` into Rust.
//! Both go into `$OUT_DIR`. A module whose text has not changed is not compiled again, whatever features are on.

#[path = "src/layout/scene_arrays.rs"]
mod scene_arrays;
#[path = "src/layout/specialization.rs"]
mod specialization;

use std::{
    collections::BTreeSet,
    env,
    fmt::Write,
    fs,
    hash::{DefaultHasher, Hash, Hasher},
    io, iter,
    path::{Path, PathBuf},
    sync::{
        Mutex,
        atomic::{AtomicUsize, Ordering},
    },
    thread,
};

/// The kernels that find hits. Each is compiled for every search of [`SEARCH_MODULES`], and those that are marked here
/// also with `WITH_ALPHA_TEST`. Casts know no materials, so they have no alpha test.
const SEARCHING: [(&str, bool); 5] =
    [("all_hits", false), ("cast", false), ("path_trace", true), ("shadow", true), ("trace", true)];

include!("src/accel/search_modules.rs");

/// A module of SPIR-V: a shader, compiled with some macros.
struct Module {
    /// The name by which Rust finds the module. It is that of the shader's file. In the names of kernels that find
    /// hits, the search and `alpha` follow the kernel's name, as in `trace_mask_alpha.comp`.
    name: String,
    path: PathBuf,
    macros: Vec<(&'static str, Option<String>)>,
}

fn main() {
    let out_dir = env::var("OUT_DIR").expect("cargo sets OUT_DIR");
    let out_dir = Path::new(&out_dir);
    println!("cargo::rerun-if-changed=glsl");
    // `kdray view --shaders` starts this program to compile changed shaders, so this file has the only compiler call,
    // with the only set of options.
    let layout = layout_in_rust().unwrap_or_else(|error| {
        println!("cargo::error={error}");
        std::process::exit(1);
    });
    fs::write(out_dir.join("layout.rs"), layout).expect("write layout.rs");
    fs::write(out_dir.join("searching_modules.rs"), table_of_searching_modules()).expect("write searching_modules.rs");

    let compiler_name = name_of_compiler();
    println!("cargo::rustc-env=KDRAY_SPIRV_COMPILER={compiler_name}");
    let cache = Cache::open(&compiler_name);
    let modules = modules();
    let n_threads = thread::available_parallelism().map_or(1, usize::from);
    let next_ix = AtomicUsize::new(0);
    let compiled = Mutex::new(Vec::new());
    thread::scope(|scope| {
        for _ in 0..n_threads {
            scope.spawn(|| {
                let compiler = shaderc::Compiler::new().expect("shaderc");
                while let Some(module) = modules.get(next_ix.fetch_add(1, Ordering::Relaxed)) {
                    let spirv = cache.get_or_compile(&compiler, module);
                    compiled.lock().expect("no thread has panicked").push((&module.name, spirv));
                }
            });
        }
    });
    let mut compiled = compiled.into_inner().expect("no thread has panicked");
    compiled.sort_by_key(|(name, _)| *name);
    let mut errors: Vec<String> = Vec::new();
    for (name, spirv) in compiled {
        match spirv {
            Ok(spirv) => fs::write(out_dir.join(format!("{name}.spv")), spirv).expect("write SPIR-V"),
            Err(error) => {
                let new: Vec<_> = error.lines().filter(|line| errors.iter().all(|known| known != line)).collect();
                errors.extend(new.into_iter().map(str::to_owned));
            }
        }
    }
    // Each line of the compiler's output becomes an error of its own, so that an editor can jump to its place. The
    // modules of a kernel share most of their errors.
    if !errors.is_empty() {
        errors.iter().for_each(|line| println!("cargo::error={line}"));
        std::process::exit(1);
    }
}

/// Generates Rust for everything that shaders and Rust share.
fn layout_in_rust() -> Result<String, String> {
    let read = |path: &str| fs::read_to_string(path).map_err(|error| format!("{path}: {error}"));
    let layout = read("glsl/shared/layout.glsl")?;
    let arrays = scene_arrays::rows(&read("glsl/shared/scene_arrays.glsl")?)?;
    scene_arrays::check_bindings(&arrays, &layout)?;
    Ok(rust_layout(&layout, &arrays) + &scene_arrays::rust(&arrays) + &constants_of_shaders(&layout)?)
}

/// Generates Rust for the specialization constants of all shaders. A shader's constants are those of its file and of
/// all files that it includes.
fn constants_of_shaders(layout: &str) -> Result<String, String> {
    let numbers = specialization::numbers(layout)?;
    let mut shaders = Vec::new();
    for Module { name, path, .. } in modules() {
        let mut declarations = Vec::new();
        for file in with_includes(&path) {
            let source = fs::read_to_string(&file).map_err(|error| format!("{}: {error}", file.display()))?;
            let shown = file.strip_prefix("glsl").expect("a file of glsl").display().to_string();
            declarations.extend(specialization::declarations(&shown, &source, &numbers)?);
        }
        shaders.push((name, declarations));
    }
    specialization::rust(&shaders)
}

/// Returns a shader's file and all files that it includes. Missing files are left to the compiler to report.
fn with_includes(path: &Path) -> BTreeSet<PathBuf> {
    let (mut files, mut open) = (BTreeSet::new(), vec![path.to_owned()]);
    while let Some(file) = open.pop() {
        let Ok(source) = fs::read_to_string(&file) else { continue };
        let included = source.lines().filter_map(|line| line.trim().strip_prefix("#include \"")?.strip_suffix('"'));
        open.extend(included.map(|name| Path::new("glsl/shared").join(name)).filter(|path| !files.contains(path)));
        files.insert(file);
    }
    files
}

/// Returns the compiler's SPIR-V version and its generator word (tool and its version), both from SPIR-V's header.
fn name_of_compiler() -> String {
    let compiler = shaderc::Compiler::new().expect("shaderc");
    let source = "#version 460\nvoid main() {}";
    let spirv = compiler.compile_into_spirv(source, shaderc::ShaderKind::Compute, "empty", "main", Some(&options(&[])));
    let spirv = spirv.expect("the compiler accepts an empty shader");
    let header = spirv.as_binary();
    format!("SPIR-V {:#x}, generator {:#010x}", header[1], header[2])
}

/// SPIR-V of earlier runs of this program, one file per module and text. It lies beside the build scripts' folders, so
/// that all sets of features share it, and hot reload too.
struct Cache {
    folder: PathBuf,
    /// Hash of what determines SPIR-V beside a module's text: the compiler, and this file, which has the options.
    state: DefaultHasher,
}

impl Cache {
    fn open(compiler_name: &str) -> Self {
        let program = env::current_exe().expect("this program's path");
        let folder = program.ancestors().nth(2).expect("cargo builds in a folder per crate").join("kdray-spirv");
        fs::create_dir_all(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        let mut state = DefaultHasher::new();
        (compiler_name, include_str!("build.rs")).hash(&mut state);
        Self { folder, state }
    }

    /// Returns a module's SPIR-V.
    ///
    /// # Errors
    /// The compiler's output. A file that cannot be read or written is an error too.
    fn get_or_compile(&self, compiler: &shaderc::Compiler, module: &Module) -> Result<Vec<u8>, String> {
        let Source { name, text, kind, options } = &module.source()?;
        // Comments and unused constants are gone from this text, so their changes compile nothing.
        let preprocessed = compiler.preprocess(text, name, "main", Some(options)).map_err(|error| error.to_string())?;
        let mut hasher = self.state.clone();
        preprocessed.as_text().hash(&mut hasher);
        let path = self.folder.join(format!("{}-{:016x}.spv", module.name, hasher.finish()));
        if let Ok(spirv) = fs::read(&path) {
            return Ok(spirv);
        }
        let artifact = compiler.compile_into_spirv(text, *kind, name, "main", Some(options));
        let spirv = artifact.map_err(|error| error.to_string())?.as_binary_u8().to_vec();
        write_whole(&path, &spirv).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(spirv)
    }
}

/// Writes a file so that no other process sees a part of it.
fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let partial = path.with_extension(std::process::id().to_string());
    fs::write(&partial, bytes)?;
    fs::rename(partial, path)
}

/// Returns all modules, in a fixed order.
fn modules() -> Vec<Module> {
    let mut modules = Vec::new();
    for path in shaders_in_order() {
        let name = path.file_name().and_then(|name| name.to_str()).expect("a shader's name is UTF-8").to_owned();
        match SEARCHING.iter().find(|(kernel, _)| name.strip_suffix(".comp") == Some(kernel)) {
            Some((kernel, has_alpha_test)) => modules.extend(searching_modules(kernel, *has_alpha_test, &path)),
            None => modules.push(Module { name, path, macros: Vec::new() }),
        }
    }
    modules
}

/// Returns the modules of a kernel that finds hits. The alpha test is inlined wherever a triangle is tested. Scenes
/// without masked or blended materials are spared it, and flat worlds are spared what is for instances.
fn searching_modules(kernel: &str, has_alpha_test: bool, path: &Path) -> Vec<Module> {
    let of_search = |search: &str| {
        let traversal = ("TRAVERSAL", Some(traversal_of(search)));
        let module = |kind: &str, macros| Module {
            name: format!("{kernel}_{search}{kind}.comp"),
            path: path.to_owned(),
            macros,
        };
        let alpha_test = has_alpha_test.then_some(("WITH_ALPHA_TEST", None));
        let with = |more: Vec<(&'static str, Option<String>)>| iter::once(traversal.clone()).chain(more).collect();
        let of_alpha = alpha_test.clone().map(|alpha_test| module("_alpha", with(vec![alpha_test])));
        let instances = alpha_test.into_iter().chain([("WITH_INSTANCES", None)]).collect();
        let of_instances = module("_instances", with(instances));
        iter::once(module("", with(Vec::new()))).chain(of_alpha).chain([of_instances]).collect::<Vec<_>>()
    };
    SEARCH_MODULES.into_iter().flat_map(of_search).collect()
}

/// Returns the value of the macro `TRAVERSAL` for a search.
fn traversal_of(search: &str) -> String {
    format!("TRAVERSAL_{}", search.to_uppercase())
}

/// Generates a Rust table of the modules of all kernels that find hits, each with its SPIR-V.
fn table_of_searching_modules() -> String {
    let is_searching = |module: &Module| !module.macros.is_empty();
    let row = |Module { name, .. }| {
        format!("Shader {{ file: {name:?}, spirv: include_bytes!(concat!(env!(\"OUT_DIR\"), \"/{name}.spv\")) }},\n")
    };
    let rows: String = modules().into_iter().filter(is_searching).map(row).collect();
    format!("&[\n{rows}]\n")
}

/// Returns the paths of all shaders, in a fixed order.
fn shaders_in_order() -> Vec<PathBuf> {
    let mut shaders: Vec<_> = ["glsl/passes", "glsl/probes", "glsl/driver"]
        .into_iter()
        .flat_map(|folder| fs::read_dir(folder).unwrap_or_else(|e| panic!("{folder}: {e}")))
        .map(|entry| entry.expect("an entry of the folder").path())
        .collect();
    shaders.sort();
    shaders
}

/// What the compiler gets of a module.
struct Source {
    /// Path of the shader's file, by which the compiler's messages name it.
    name: String,
    text: String,
    kind: shaderc::ShaderKind,
    options: shaderc::CompileOptions<'static>,
}

impl Module {
    fn source(&self) -> Result<Source, String> {
        let Self { name, path, macros } = self;
        let kind = match path.extension().and_then(|e| e.to_str()) {
            Some("comp") => shaderc::ShaderKind::Compute,
            Some("vert") => shaderc::ShaderKind::Vertex,
            Some("frag") => shaderc::ShaderKind::Fragment,
            Some("rgen") => shaderc::ShaderKind::RayGeneration,
            Some("rmiss") => shaderc::ShaderKind::Miss,
            Some("rchit") => shaderc::ShaderKind::ClosestHit,
            _ => return Err(format!("{name}: a shader ends in .comp, .vert, .frag, .rgen, .rmiss or .rchit")),
        };
        let name = path.display().to_string();
        let text = fs::read_to_string(path).map_err(|error| format!("{name}: {error}"))?;
        Ok(Source { name, text, kind, options: options(macros) })
    }
}

/// Returns the compiler's options: Vulkan 1.3, optimized. `#include "x.glsl"` reads from glsl/shared.
fn options(macros: &[(&str, Option<String>)]) -> shaderc::CompileOptions<'static> {
    let mut options = shaderc::CompileOptions::new().expect("shaderc");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_3 as u32);
    options.set_optimization_level(shaderc::OptimizationLevel::Performance);
    options.set_warnings_as_errors();
    for (name, value) in macros {
        options.add_macro_definition(name, value.as_deref());
    }
    // Values of the macro `TRAVERSAL`: the algorithm that takes rays through the kd-tree, or the grid.
    for (ix, search) in SEARCH_MODULES.into_iter().enumerate() {
        options.add_macro_definition(&traversal_of(search), Some(&format!("{ix}u")));
    }
    options.set_include_callback(|include, _, _, _| {
        let path = Path::new("glsl/shared").join(include);
        let content = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        Ok(shaderc::ResolvedInclude { resolved_name: path.display().to_string(), content })
    });
    options
}

/// Generates Rust constants and structs from layout.glsl.
///
/// # Panics
/// A struct has a member of an unknown type, or std430 would pad a struct.
fn rust_layout(glsl: &str, arrays: &[scene_arrays::Row]) -> String {
    let mut rust = String::new();
    let mut doc = String::new();
    let mut structs = String::new(); // elements of `STRUCTS`, which a test compares with the SPIR-V
    let mut layout: Option<(String, usize, usize)> = None; // struct name, bytes so far, widest alignment
    for line in glsl.lines().map(str::trim) {
        if let Some(comment) = line.strip_prefix("//") {
            writeln!(doc, "///{comment}").unwrap();
            continue;
        }
        if let Some((name, offset, widest)) = layout.as_mut() {
            if line == "#include \"scene_arrays.glsl\"" {
                for scene_arrays::Row { name: array, .. } in arrays {
                    assert_eq!(*offset % 8, 0, "layout.glsl: std430 pads {name}.{array} (offset {offset})");
                    writeln!(rust, "    pub {array}: [u32; 2],").unwrap();
                    write!(structs, "(\"[u32; 2]\", std::mem::offset_of!({name}, {array})),").unwrap();
                    *offset += 8;
                }
                // GLSL rounds the struct's size up to its alignment. In Rust, a reserved member does so.
                if *offset % *widest != 0 {
                    writeln!(rust, "    pub reserved: [u32; 2],").unwrap();
                    *offset += 8;
                }
            } else if line.starts_with('#') {
                // The macro ARRAY, which is defined and undefined within the struct, is for GLSL only.
            } else if line == "};" {
                assert_eq!(*offset % *widest, 0, "layout.glsl: std430 pads the end of {name} ({offset} bytes)");
                writeln!(rust, "}}\nconst _: () = assert!(size_of::<{name}>() == {offset});").unwrap();
                write!(structs, "]),").unwrap();
                layout = None;
            } else if let Some((ty, member)) = line.trim_end_matches(';').split_once(' ') {
                let (rust_ty, bytes, align) = rust_type(ty);
                assert_eq!(*offset % align, 0, "layout.glsl: std430 pads {name}.{member} (offset {offset})");
                writeln!(rust, "    pub {member}: {rust_ty},").unwrap();
                write!(structs, "({rust_ty:?}, std::mem::offset_of!({name}, {member})),").unwrap();
                *offset += bytes;
                *widest = align.max(*widest);
            }
        } else if let Some(rest) = line.strip_prefix("struct ") {
            let name = rest.trim_end_matches(" {");
            writeln!(
                rust,
                "{doc}#[repr(C)]\n\
                 #[derive(Clone, Copy, Debug, Default, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]\n\
                 pub struct {name} {{"
            )
            .unwrap();
            write!(structs, "({name:?}, size_of::<{name}>(), &[").unwrap();
            layout = Some((name.to_owned(), 0, 4));
        } else if let Some((name, value)) = line.strip_prefix("#define ").and_then(|rest| rest.split_once(' ')) {
            let value = value.trim().trim_end_matches('u');
            let ty = if value.contains('.') { "f32" } else { "u32" };
            writeln!(rust, "{doc}pub const {name}: {ty} = {value};").unwrap();
        }
        doc.clear();
    }
    let members = "/// Name, size, and each member's type and offset.";
    writeln!(rust, "{members}\n#[cfg(test)]\nconst STRUCTS: &[Struct] = &[{structs}];").unwrap();
    rust
}

/// Returns the Rust type, the size in bytes and the std430 alignment in bytes of a GLSL type.
fn rust_type(glsl: &str) -> (&'static str, usize, usize) {
    match glsl {
        "uint" => ("u32", 4, 4),
        "float" => ("f32", 4, 4),
        "uvec2" => ("[u32; 2]", 8, 8),
        "vec3" => ("glam::Vec3", 12, 16),
        "mat4" => ("glam::Mat4", 64, 16),
        _ => panic!("layout.glsl: no Rust type for `{glsl}`"),
    }
}
