//! Hot reload of shaders: when their files change, the build script compiles them as it does for cargo, and the
//! renderer goes on with them.

use std::{
    collections::BTreeSet,
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Output, Stdio},
    thread,
    time::{Instant, SystemTime},
};

use tempfile::TempDir;
use winit::event_loop::EventLoopProxy;

use super::{
    gpu_session::GpuSession,
    message::Topic,
    reload::{OneAtATime, Wake},
    session::Session,
    watch::Watch,
};
use crate::gpu::Replacements;

/// The Rust code that was generated from layout.glsl when this program was built.
const LAYOUT: &str = include_str!(concat!(env!("OUT_DIR"), "/layout.rs"));

/// Watches the shaders' files and compiles them again on a thread of its own.
pub struct Shaders {
    checkout: PathBuf,
    proxy: EventLoopProxy<Wake>,
    /// None if the system refuses to watch.
    _watch: Option<Watch>,
    compiling: OneAtATime,
}

impl Shaders {
    /// Watches the shaders of a checkout of kdray.
    pub fn new(checkout: &Path, proxy: EventLoopProxy<Wake>) -> Self {
        let waker = proxy.clone();
        // An error means that the viewer has ended; then nothing needs to be woken.
        let changed = move || drop(waker.send_event(Wake::ShadersChanged));
        let watch = Watch::new(&shader_files(checkout), changed)
            .inspect_err(|error| tracing::warn!("the shaders are not watched: {error}"))
            .ok();
        Self { checkout: checkout.to_owned(), proxy, _watch: watch, compiling: OneAtATime::default() }
    }

    /// Starts to compile all shaders. If a compilation is under way, another one starts when it has ended.
    pub fn compile(&mut self) {
        if self.compiling.begin() {
            let (checkout, proxy) = (self.checkout.clone(), self.proxy.clone());
            thread::spawn(move || drop(proxy.send_event(Wake::Compiled(compile(&checkout)))));
        }
    }

    /// Notes that a compilation has ended, and starts the one that is due.
    pub fn compiled(&mut self) {
        if self.compiling.end() {
            self.compile();
        }
    }
}

impl Session {
    /// Replaces the shaders. If they failed to compile or the device refuses them, shows a message and keeps the
    /// previous shaders. Returns whether it succeeded.
    pub fn replace_shaders(&mut self, gpu: &mut GpuSession, shaders: Result<Replacements, String>) -> bool {
        let replaced =
            shaders.and_then(|shaders| gpu.replace_shaders(shaders).map_err(|error| format!("shaders: {error}")));
        match &replaced {
            Ok(()) => {
                // The next picture is drawn small, so that it is shown at once.
                self.pace.moved(Instant::now());
                self.clear_message(Topic::Shaders);
            }
            Err(error) => self.show_error(Topic::Shaders, error),
        }
        replaced.is_ok()
    }
}

/// Returns all files below the checkout's `glsl`.
fn shader_files(checkout: &Path) -> BTreeSet<PathBuf> {
    let (mut files, mut folders) = (BTreeSet::new(), vec![checkout.join("glsl")]);
    while let Some(folder) = folders.pop() {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let (inner, new): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
        folders.extend(inner);
        files.extend(new);
    }
    files
}

/// Returns the compiler: the program of build.rs, which cargo leaves beside what it builds. Of several, the latest.
///
/// # Errors
/// This program does not lie where cargo has built it.
fn compiler() -> Result<PathBuf, String> {
    let program = env::current_exe().map_err(|error| format!("shaders: {error}"))?;
    let name = format!("build-script-build{}", env::consts::EXE_SUFFIX);
    // Programs of tests lie one folder below the others.
    let folders = program.ancestors().skip(1).take(2).filter_map(|folder| fs::read_dir(folder.join("build")).ok());
    let of_kdray =
        folders.flatten().flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with("kdray-"));
    let built = of_kdray.map(|entry| entry.path().join(&name)).filter_map(|path| Some((modified(&path)?, path)));
    let latest = built.max().map(|(_, path)| path);
    latest.ok_or_else(|| format!("--shaders needs {name}, which cargo leaves in the folder `build` beside kdray"))
}

fn modified(path: &Path) -> Option<SystemTime> {
    fs::metadata(path).and_then(|it| it.modified()).ok()
}

/// Compiles all shaders of the checkout.
///
/// # Errors
/// The compiler's errors with file and line, or why it could not run. It is also an error if layout.glsl differs from
/// the one that this program was built with.
fn compile(checkout: &Path) -> Result<Replacements, String> {
    let out_dir = TempDir::new().map_err(|error| format!("shaders: {error}"))?;
    let compiler = compiler()?;
    let output = Command::new(&compiler)
        .current_dir(checkout)
        .env("OUT_DIR", out_dir.path())
        .env("RUST_BACKTRACE", "0")
        .stdin(Stdio::null())
        .output()
        .map_err(|error| format!("{}: {error}", compiler.display()))?;
    if !output.status.success() {
        return Err(complaints(&output));
    }
    let read = |path: &Path| fs::read(path).map_err(|error| format!("{}: {error}", path.display()));
    let layout = read(&out_dir.path().join("layout.rs"))?;
    if code_of(&String::from_utf8_lossy(&layout)) != code_of(LAYOUT) {
        return Err("glsl/shared/layout.glsl: the program shares its structs and constants and must be built again \
                    to use others; the previous shaders stay in use"
            .to_owned());
    }
    let files = fs::read_dir(out_dir.path()).into_iter().flatten().flatten().map(|entry| entry.path());
    let modules = files.filter(|path| path.extension().is_some_and(|extension| extension == "spv"));
    modules
        .map(|path| {
            let shader = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            Ok((shader, read(&path)?))
        })
        .collect()
}

/// Returns the build script's error messages: those that it prints for cargo or, if there are none, its panic
/// message, which reports errors in layout.glsl.
fn complaints(output: &Output) -> String {
    let (stdout, stderr) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    let errors = stdout.lines().filter_map(|line| line.strip_prefix("cargo::error="));
    // The lines that introduce the errors or count them are left out.
    let errors: Vec<_> =
        errors.filter(|line| !line.ends_with("compilation error:") && !line.ends_with("errors:")).collect();
    if !errors.is_empty() {
        return errors.join("\n");
    }
    let is_why = |line: &&str| !line.trim().is_empty() && !line.starts_with("thread ") && !line.starts_with("note:");
    stderr.lines().filter(is_why).collect::<Vec<_>>().join("\n")
}

/// Returns the lines that are not doc comments.
fn code_of(rust: &str) -> Vec<&str> {
    rust.lines().filter(|line| !line.trim_start().starts_with("///")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Copies this checkout's shaders to a new directory and edits one of the files.
    fn edited(file: &str, edit: impl Fn(&str) -> String) -> TempDir {
        let copy = TempDir::new().unwrap();
        for path in shader_files(Path::new(env!("CARGO_MANIFEST_DIR"))) {
            let inside = path.strip_prefix(env!("CARGO_MANIFEST_DIR")).unwrap();
            let text = fs::read_to_string(&path).unwrap();
            fs::create_dir_all(copy.path().join(inside).parent().unwrap()).unwrap();
            let text = if inside == Path::new(file) { edit(&text) } else { text };
            fs::write(copy.path().join(inside), text).unwrap();
        }
        copy
    }

    #[test]
    fn unchanged_shaders_are_those_that_the_program_brings_along() {
        let copy = edited("glsl/shared/layout.glsl", |text| text.replacen("// ", "// Documentation: ", 1));
        let modules = compile(copy.path()).unwrap();
        let trace = include_bytes!(concat!(env!("OUT_DIR"), "/trace_mask.comp.spv"));
        assert_eq!(modules["trace_mask.comp"], trace);
        let copy = edited("glsl/passes/trace.comp", |text| text.replace("void main() {", "void main() { return;"));
        assert_ne!(compile(copy.path()).unwrap()["trace_mask.comp"], trace);
    }

    #[test]
    fn errors_name_file_and_line() {
        let line_of = |text: &str| 1 + text.lines().position(|line| line.contains("void main()")).unwrap();
        let text = include_str!("../../glsl/passes/trace.comp");
        let copy = edited("glsl/passes/trace.comp", |text| text.replace("void main() {", "void main() { oops();"));
        let error = compile(copy.path()).unwrap_err();
        assert!(error.starts_with(&format!("glsl/passes/trace.comp:{}: error: 'oops'", line_of(text))), "{error}");
        for shared in ["glsl/shared/kdtree/kdtree.glsl", "glsl/shared/bsdf/bsdf.glsl"] {
            let copy = edited(shared, |text| format!("oops\n{text}"));
            let error = compile(copy.path()).unwrap_err();
            assert!(error.contains(&format!("{shared}:")), "{error}");
        }
    }

    #[test]
    fn another_layout_is_refused() {
        let layout = "glsl/shared/layout.glsl";
        let copy =
            edited(layout, |text| text.replacen("#define PIXEL_GROUP_SIZE 8u", "#define PIXEL_GROUP_SIZE 4u", 1));
        assert!(compile(copy.path()).unwrap_err().starts_with(layout));
        let copy = edited(layout, |text| format!("{text}\nstruct Bad {{\n    float a;\n    vec3 b;\n}};\n"));
        let error = compile(copy.path()).unwrap_err();
        assert!(error.contains("layout.glsl: std430 pads Bad.b (offset 4)"), "{error}");
    }
}
