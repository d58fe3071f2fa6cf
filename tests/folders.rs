//! Tests that the folders of `src` use each other only as the table in docs/architecture.md allows, and that unsafe
//! code is in its folder.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
};

/// A row of the table: folders with one place in the order.
struct Row {
    folders: Vec<String>,
    /// Folders further down that these may use all the same.
    exceptions: Vec<String>,
}

/// Returns the rows of a table of the section "The folders", from the top. `head`: the first cell of its head.
fn rows(architecture: &str, head: &str) -> Vec<Row> {
    let section = architecture.split("\n## ").find(|section| section.starts_with("The folders\n"));
    let lines =
        section.expect("a section").lines().skip_while(|line| !line.starts_with(&format!("| {head} |"))).skip(2);
    let table = lines.map_while(|line| {
        let cells: Vec<_> = line.strip_prefix('|')?.strip_suffix('|')?.split('|').collect();
        Some(Row { folders: quoted(cells[0]), exceptions: cells.get(2).map(|cell| quoted(cell)).unwrap_or_default() })
    });
    table.collect()
}

/// Returns the words between backticks.
fn quoted(cell: &str) -> Vec<String> {
    cell.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Returns a file's code up to its unit tests, without comments.
fn code_of(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod ").next().unwrap_or_default();
    code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Returns the modules below `prefix` that the code uses: for `crate::`, `name` of `crate::name` and of
/// `crate::{name, ..}`.
fn used(code: &str, prefix: &str) -> BTreeSet<String> {
    let name = |text: &str| text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let mut names = BTreeSet::new();
    for rest in code.split(prefix).skip(1) {
        let Some(group) = rest.strip_prefix('{') else {
            names.insert(name(rest));
            continue;
        };
        let (mut depth, mut is_first) = (1, true);
        for (at, c) in group.char_indices() {
            if is_first && depth == 1 && c.is_alphabetic() {
                names.insert(name(&group[at..]));
                is_first = false;
            }
            match c {
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 1 => is_first = true,
                _ => {}
            }
            if depth == 0 {
                break;
            }
        }
    }
    // Modules have small letters.
    names.retain(|name| name.starts_with(char::is_lowercase));
    names
}

/// Returns all Rust files below a folder but those of tests.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let (folders, files): (Vec<_>, Vec<_>) = entries.partition(|path| path.is_dir());
    let is_source = |path: &PathBuf| {
        let stem = path.file_stem().unwrap().to_str().unwrap();
        path.extension().is_some_and(|it| it == "rs") && !stem.split('_').any(|word| word == "tests")
    };
    let inner = folders.iter().filter(|folder| !folder.ends_with("tests")).flat_map(|folder| sources(folder));
    files.into_iter().filter(is_source).chain(inner).collect()
}

/// Returns what a table does not allow of what a file uses. `file`: its path below the folder of `prefix`.
fn violations(rows: &[Row], prefix: &str, file: &str, code: &str) -> Vec<String> {
    let places: BTreeMap<&str, usize> =
        rows.iter().enumerate().flat_map(|(ix, row)| row.folders.iter().map(move |name| (&name[..], ix))).collect();
    // Files beside the folders, as lib.rs, are above all.
    let Some((folder, _)) = file.split_once('/') else { return Vec::new() };
    let Some(&place) = places.get(folder) else { return vec![format!("{file}: the table has no `{folder}`")] };
    let is_refused = |name: &&String| match places.get(&name[..]) {
        Some(&other) => other > place && !rows[place].exceptions.contains(name),
        // Other crates have modules of that name, too.
        None => prefix == "crate::",
    };
    used(code, prefix).iter().filter(is_refused).map(|name| format!("{file} uses `{name}`")).collect()
}

/// Returns the table of the folders of `src`, or of the rooms of one of them.
fn table(head: &str) -> Vec<Row> {
    let rows = rows(&fs::read_to_string("docs/architecture.md").unwrap(), head);
    assert!(rows.len() > 5 && rows.iter().all(|row| !row.folders.is_empty()), "{head}");
    rows
}

/// Returns what the tables do not allow in a folder, and how many uses there are.
fn checked(rows: &[Row], prefix: &str, folder: &str) -> (Vec<String>, usize) {
    let (mut found, mut n_uses) = (Vec::new(), 0);
    for path in sources(Path::new(folder)) {
        let code = code_of(&fs::read_to_string(&path).unwrap());
        let file = path.strip_prefix(folder).unwrap().to_str().unwrap().to_owned();
        n_uses += used(&code, prefix).len();
        found.extend(violations(rows, prefix, &file, &code));
    }
    (found, n_uses)
}

#[test]
fn folders_use_only_what_the_table_allows() {
    let (found, n_uses) = checked(&table("folder"), "crate::", "src");
    assert!(n_uses > 500, "{n_uses} uses were found");
    assert!(found.is_empty(), "{found:#?}");
}

#[test]
fn rooms_of_scenes_use_only_those_above_them() {
    let rows = table("room of `scene`");
    let (found, n_uses) = checked(&rows, "scene::", "src/scene");
    assert!(n_uses > 100, "{n_uses} uses were found");
    assert!(found.is_empty(), "{found:#?}");
    let of = |file: &str, code: &str| violations(&rows, "scene::", file, code);
    let upward = "use crate::{\n    scene::{\n        files::store,\n        guess::standard,\n    },\n};";
    assert_eq!(of("formats/x.rs", upward), ["formats/x.rs uses `guess`"]);
    assert_eq!(of("model/x.rs", "use crate::scene::{files::store, model::Mesh};"), ["model/x.rs uses `files`"]);
}

#[test]
fn forbidden_uses_are_found() {
    let rows = table("folder");
    let of = |file: &str, code: &str| violations(&rows, "crate::", file, &code_of(code));
    assert_eq!(of("gpu/x.rs", "use crate::scene::Scene;"), ["gpu/x.rs uses `scene`"]);
    assert_eq!(
        of("world/x.rs", "use crate::{\n    layout::{A, B},\n    reference::texture,\n};"),
        ["world/x.rs uses `reference`"]
    );
    assert_eq!(of("cpu/x.rs", "fn f() { crate::passes::g() }"), ["cpu/x.rs uses `passes`"]);
    assert_eq!(of("new/x.rs", ""), ["new/x.rs: the table has no `new`"]);
    assert_eq!(of("scene/x.rs", "use crate::{frame::Denoise, util};\n// crate::engine\n"), [""; 0]);
    assert_eq!(of("gpu/x.rs", "#[cfg(test)]\nmod tests {\n    use crate::engine;\n}"), [""; 0]);
}

/// What opens files or asks for them, beside the module `fs`.
const OPENS_FILES: [&str; 8] =
    ["fs::", "File::open(", "OpenOptions", "image::open(", "canonicalize(", "metadata(", "read_dir(", "try_exists("];

/// Returns what of some code opens files.
fn opened_by(code: &str) -> Vec<&'static str> {
    let module = used(code, "std::").contains("fs").then_some("fs");
    module.into_iter().chain(OPENS_FILES.into_iter().filter(|what| n_calls(code, what) > 0)).collect()
}

/// Readers take bytes, and a `SourceFile` for what a file names: it alone says what may be read, and how much.
#[test]
fn files_of_scenes_are_opened_in_one_room() {
    let (inside, others): (Vec<_>, Vec<_>) =
        sources(Path::new("src/scene")).into_iter().partition(|path| path.starts_with("src/scene/files"));
    let opened = |path: &PathBuf| opened_by(&code_of(&fs::read_to_string(path).unwrap()));
    let found: Vec<_> = others.iter().map(|path| (path, opened(path))).filter(|(_, what)| !what.is_empty()).collect();
    assert!(others.len() > 50 && found.is_empty(), "{found:#?}");
    assert!(inside.iter().any(|path| !opened(path).is_empty()), "{inside:?}");
    assert_eq!(opened_by("use std::{\n    fs,\n    path::Path,\n};"), ["fs"]);
    assert_eq!(opened_by("let a = std::fs::read(path)?;"), ["fs", "fs::"]);
    assert_eq!(opened_by("let a = io::File::open(path)?; let b = OtherFile::open(path)?;"), ["File::open("]);
    assert_eq!(opened_by("let a = path.canonicalize()?; let b = file.canonical();"), ["canonicalize("]);
    assert_eq!(opened_by("let a = offs::x(); file.bytes()?"), [""; 0]);
}

/// `#![deny(unsafe_code)]` holds where nothing allows it.
#[test]
fn unsafe_code_is_in_the_vulkan_layer() {
    for root in ["src/lib.rs", "src/main.rs"] {
        assert!(fs::read_to_string(root).unwrap().contains("#![deny(unsafe_code)]"), "{root}");
    }
    let manifest = fs::read_to_string("python/Cargo.toml").unwrap();
    assert!(manifest.contains("[lints.rust]\nunsafe_code = \"forbid\""), "the package for Python has none");
    let allows = |path: &PathBuf| fs::read_to_string(path).unwrap().contains("allow(unsafe_code");
    let found: Vec<_> = sources(Path::new("src")).into_iter().filter(allows).collect();
    assert!(!found.is_empty() && found.iter().all(|path| path.starts_with("src/gpu")), "{found:?}");
}

/// What loading consists of, and the only files that may call it: `scene` itself aside. Packs are made of scene files
/// as they are.
const ONE_WAY_IN: &[(&str, &[&str])] = &[
    ("Scene::load", &["engine/load.rs", "pack/mod.rs"]),
    ("choose_accel(", &["engine/load.rs", "engine/choices/mod.rs"]),
    ("metered_exposure(", &["engine/load.rs", "cpu/meter.rs"]),
    ("require_for_build(", &["engine/load.rs", "engine/memory.rs"]),
];

/// Returns how often the code contains `call`, but not as the end of a longer name.
fn n_calls(code: &str, call: &str) -> usize {
    let is_whole = |at: usize| !code[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    code.match_indices(call).filter(|(at, _)| is_whole(*at)).count()
}

#[test]
fn there_is_one_way_into_the_library() {
    let sources = sources(Path::new("src"));
    let codes = sources.iter().map(|path| (path.strip_prefix("src").unwrap(), fs::read_to_string(path).unwrap()));
    let codes: Vec<_> = codes.map(|(path, text)| (path.to_str().unwrap(), code_of(&text))).collect();
    for (call, allowed) in ONE_WAY_IN {
        let is_caller = |(file, code): &&(&str, String)| !file.starts_with("scene/") && n_calls(code, call) > 0;
        let callers: BTreeSet<_> = codes.iter().filter(is_caller).map(|(file, _)| *file).collect();
        assert_eq!(callers, allowed.iter().copied().collect(), "{call}");
        let (_, load) = codes.iter().find(|(file, _)| *file == "engine/load.rs").unwrap();
        assert_eq!(n_calls(load, call), 1, "{call}");
    }
    assert_eq!(n_calls("let a = Scene::load(b)?; let c = LoadedScene::load(d)?;", "Scene::load"), 1);
}
