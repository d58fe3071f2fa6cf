//! Tests of `kdray doctor`.

use std::{fs, path::Path, process::Output};

use crate::support::{
    command::{cornell, kdray, stderr, stdout},
    kept,
};
use serde_json::Value;
use tempfile::TempDir;

/// Runs the command, which has to end with an exit code.
fn doctor(directory: &Path, arguments: &[&str], code: i32) -> Output {
    let output = kdray(directory, &[&["doctor"], arguments].concat()).output().unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {}{}", stdout(&output), stderr(&output));
    output
}

fn json(output: &Output) -> Value {
    serde_json::from_str(&stdout(output)).unwrap()
}

#[test]
fn a_healthy_machine_is_found_so() {
    let directory = TempDir::new().unwrap();
    let text = stdout(&doctor(directory.path(), &[], 0));
    let lines: Vec<_> = text.lines().collect();
    assert!(lines[0].starts_with(concat!("kdray ", env!("CARGO_PKG_VERSION"), " on ")), "{text}");
    assert!(lines[1].contains(" CPU threads, memory ") && !lines[1].contains("unknown"), "{text}");
    assert!(lines.contains(&"Vulkan: ok") && lines.contains(&"CPU"), "{text}");
    assert!(text.contains("device 0: ") && text.contains("  sample picture: ok, "), "{text}");
    assert!(text.contains(" of 3072 pixels differ from the CPU's"), "{text}");
    assert!(lines.last().unwrap().starts_with("ok: 1 of 1 Vulkan devices can render"), "{text}");

    let found = json(&doctor(directory.path(), &["--json"], 0));
    let processors = found["processors"].as_array().unwrap();
    assert_eq!(processors.len(), 2);
    assert!(processors.iter().all(|processor| processor["sample"]["ok"] == true), "{found}");
    assert!(processors[0]["device"]["memory_bytes"].as_u64() > Some(1 << 20), "{found}");
    assert_eq!((&processors[1]["device"], &found["scene"]), (&Value::Null, &Value::Null));
}

#[test]
fn a_scene_is_examined_on_each_processor() {
    if kept::leaves_out("the hash of a flattened scene") {
        return;
    }
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let found = json(&doctor(path, &[&cornell(), "--json"], 0));
    let scene = &found["scene"]["found"];
    assert_eq!((&scene["name"], scene["triangles"].as_u64()), (&"cornell".into(), Some(34)));
    for processor in found["processors"].as_array().unwrap() {
        assert_eq!(processor["scene"]["ok"], true, "{found}");
    }
    let needed = |found: &Value| found["processors"][0]["scene"]["found"]["needed_bytes"].as_u64().unwrap();
    // The picture has 768x768 pixels, each of which takes at least its radiance and its colour.
    assert!(needed(&found) > 768 * 768 * 20 && needed(&found) < 1 << 30, "{}", needed(&found));
    // A smaller picture of the same scene needs less memory.
    let text = fs::read_to_string(cornell()).unwrap().replace("= 768", "= 96");
    fs::write(path.join("small.toml"), text).unwrap();
    let small = json(&doctor(path, &["small.toml", "--json"], 0));
    assert!(needed(&small) < needed(&found) / 4, "{} {}", needed(&small), needed(&found));
    assert_eq!(small["scene"]["found"]["hash"], scene["hash"]);

    // The hash is the one that pictures state.
    let render = kdray(path, &["render", "small.toml", "--cpu", "-q", "-o", "small.png"]).output().unwrap();
    assert!(render.status.success(), "{}", stderr(&render));
    let hash = scene["hash"].as_str().unwrap();
    let png = fs::read(path.join("small.png")).unwrap();
    assert!(png.windows(hash.len()).any(|bytes| bytes == hash.as_bytes()), "{hash}");
    let text = stdout(&doctor(path, &["small.toml"], 0));
    assert!(text.contains(&format!("scene: ok, small, 34 triangles, hash {hash}")), "{text}");
    assert_eq!(text.matches("\n  scene: ok, ").count(), 2, "{text}");
}

/// The report has the hash that `kdray pack` prints, of a pack and of a scene in it, and none of other scenes.
#[test]
fn a_pack_has_its_own_hash() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    let packed = kdray(path, &["pack", &cornell(), "-o", "c.kdpack"]).output().unwrap();
    let hash = stdout(&packed).lines().find_map(|line| Some(line.strip_prefix("hash ")?.to_owned())).unwrap();
    for scene in ["c.kdpack", "c.kdpack/cornell.toml"] {
        let text = stdout(&doctor(path, &[scene], 0));
        assert!(text.lines().any(|line| line == format!("  pack with hash {hash}")), "{text}");
        let found = &json(&doctor(path, &[scene, "--json"], 0))["scene"]["found"];
        assert_eq!(found["pack_hash"], *hash);
        assert_ne!(found["hash"], *hash);
    }
    assert!(!stdout(&doctor(path, &[&cornell()], 0)).contains("pack with"));
    assert_eq!(json(&doctor(path, &[&cornell(), "--json"], 0))["scene"]["found"]["pack_hash"], Value::Null);
}

#[test]
fn a_wrong_scene_ends_with_3_and_names_the_file() {
    let directory = TempDir::new().unwrap();
    let path = directory.path();
    fs::write(path.join("lacks.toml"), "[[mesh]]\nfile = \"absent.obj\"\n").unwrap();
    for (scene, named) in [("lacks.toml", "absent.obj"), ("none.kdpack", "none.kdpack")] {
        let output = doctor(path, &[scene], 3);
        assert!(stderr(&output).lines().last().unwrap().starts_with("error: "), "{}", stderr(&output));
        let text = stdout(&output);
        let line = text.lines().find(|line| line.starts_with("scene: wrong: ")).unwrap_or_else(|| panic!("{text}"));
        assert!(line.contains(named), "{line}");
        let found = json(&doctor(path, &[scene, "--json"], 3));
        assert!(found["scene"]["problem"].as_str().unwrap().contains(named), "{found}");
    }
}

/// Without a driver, the CPU still renders, and a scene is examined there.
#[test]
fn a_machine_without_a_driver_renders_on_the_cpu() {
    let directory = TempDir::new().unwrap();
    let scene = cornell();
    for arguments in [&["doctor"][..], &["doctor", &scene]] {
        let mut command = kdray(directory.path(), arguments);
        let none = directory.path().join("none.json");
        let output = command.env("VK_DRIVER_FILES", &none).env("VK_ICD_FILENAMES", &none).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let text = stdout(&output);
        assert!(text.contains("\nVulkan: wrong: "), "{text}");
        assert!(text.contains("render with --cpu") && !text.contains("device 0"), "{text}");
        assert_eq!(text.lines().last(), Some("ok, but only the CPU can render: use --cpu"), "{text}");
        assert_eq!(text.matches("\n  scene: ok, ").count(), arguments.len() - 1, "{text}");
    }
}

/// An empty file in the place of the Vulkan loader is as good as none.
#[cfg(target_os = "linux")]
#[test]
fn a_machine_without_a_loader_renders_on_the_cpu() {
    let directory = TempDir::new().unwrap();
    fs::write(directory.path().join("libvulkan.so.1"), "").unwrap();
    let output = kdray(directory.path(), &["doctor"]).env("LD_LIBRARY_PATH", directory.path()).output().unwrap();
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(0), "{text}{}", stderr(&output));
    assert!(text.contains("\nVulkan: wrong: no Vulkan loader"), "{text}");
    assert_eq!(text.lines().last(), Some("ok, but only the CPU can render: use --cpu"), "{text}");
}

/// Runs doctor with these manifests of drivers alone.
#[cfg(target_os = "linux")]
fn doctor_with(directory: &Path, manifests: &str) -> Output {
    let mut command = kdray(directory, &["doctor"]);
    let output = command.env("VK_DRIVER_FILES", manifests).env("VK_ICD_FILENAMES", manifests).output().unwrap();
    assert_eq!(output.status.code(), Some(0), "{}{}", stdout(&output), stderr(&output));
    output
}

#[cfg(target_os = "linux")]
fn write_manifest(directory: &Path, name: &str, library: &Path) -> String {
    let path = directory.join(name);
    let icd = serde_json::json!({ "library_path": library, "api_version": "1.3.0" });
    fs::write(&path, serde_json::json!({ "file_format_version": "1.0.0", "ICD": icd }).to_string()).unwrap();
    path.display().to_string()
}

/// Returns the manifest of the driver with which the tests run, or of lavapipe.
#[cfg(target_os = "linux")]
fn good_driver() -> String {
    let is_lavapipe = |path: &std::path::PathBuf| path.to_string_lossy().contains("lvp_icd");
    let installed = || fs::read_dir("/usr/share/vulkan/icd.d").unwrap().map(|entry| entry.unwrap().path());
    let lavapipe = || installed().find(is_lavapipe).expect("lavapipe").display().to_string();
    std::env::var("VK_DRIVER_FILES").unwrap_or_else(|_| lavapipe())
}

/// Returns the report's line that begins with these words.
#[cfg(target_os = "linux")]
fn line(output: &Output, begin: &str) -> String {
    let text = stdout(output);
    text.lines().find(|line| line.starts_with(begin)).unwrap_or_else(|| panic!("{text}")).to_owned()
}

/// The reason why there is no GPU is told for each driver.
#[cfg(target_os = "linux")]
#[test]
fn a_library_that_is_missing_is_named() {
    let directory = TempDir::new().unwrap();
    let manifest = write_manifest(directory.path(), "gone.json", Path::new("libGLX_gone.so.0"));
    let told = line(&doctor_with(directory.path(), &manifest), &format!("driver {manifest}: wrong: "));
    assert!(told.contains("its library `libGLX_gone.so.0` cannot be loaded: libGLX_gone.so.0: cannot open"), "{told}");
}

/// A driver that never answers hides the others. The manifest's library is a pipe that nobody writes to, on which the
/// system's loader waits for ever.
#[cfg(target_os = "linux")]
#[test]
fn a_driver_that_hangs_is_named_and_left_out() {
    let directory = TempDir::new().unwrap();
    let pipe = directory.path().join("libhangs.so");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let hangs = write_manifest(directory.path(), "hangs.json", &pipe);
    let good = good_driver();
    let output = doctor_with(directory.path(), &format!("{hangs}:{good}"));
    let told = line(&output, &format!("driver {hangs}: wrong: "));
    assert!(told.contains("has not answered within") && told.ends_with(&format!("VK_DRIVER_FILES={good}")), "{told}");
    assert!(line(&output, "Vulkan: ").contains("leave out the driver"), "{}", stdout(&output));
}

/// A picture that no memory holds is refused with what to do about it.
#[test]
fn a_picture_beyond_the_memory_ends_with_4() {
    let directory = TempDir::new().unwrap();
    let text = fs::read_to_string(cornell()).unwrap().replace("= 768", "= 16384");
    fs::write(directory.path().join("large.toml"), text).unwrap();
    let limited = "ulimit -v 4000000; exec \"$0\" doctor large.toml";
    let output = std::process::Command::new("sh")
        .args(["-c", limited, env!("CARGO_BIN_EXE_kdray")])
        .current_dir(directory.path())
        .output()
        .unwrap();
    let text = stdout(&output);
    assert_eq!(output.status.code(), Some(4), "{text}{}", stderr(&output));
    assert!(text.contains("  scene: wrong: ") && text.contains("--tile"), "{text}");
    assert!(text.lines().last().unwrap().starts_with("wrong: neither a Vulkan device nor the CPU"), "{text}");
}
