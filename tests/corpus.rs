//! Reads all files of `tests/corpus`: those that once broke a reader, and those with which the fuzz targets (`fuzz/`)
//! reach most of its code. docs/conventions.md says how the targets are run.

#[path = "support/hostile.rs"]
mod hostile;

use std::{fs, path::Path};

use hostile::{Format, Reader, check_error};

#[test]
fn no_file_breaks_a_reader() {
    let reader = Reader::new();
    for (format, folder) in Format::ALL {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(folder);
        let mut files: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
        files.sort();
        assert!(!files.is_empty(), "{} has no files", folder.display());
        let mut n_read = 0;
        for file in &files {
            // A panic is told from others by this line.
            eprintln!("{}", file.display());
            n_read += usize::from(reader.check(format, &fs::read(file).unwrap()).is_none());
        }
        // What is wrong in an MTL file is left out with a warning.
        assert!(n_read < files.len() || format == Format::Mtl, "all {} files are read", files.len());
        // Parts are those of one version of kdray. Others refuse all of them.
        assert!(0 < n_read || format == Format::Part, "none of {} files is read", files.len());
    }
}

/// A pack that was changed is read on behind its hashes, which no longer fit.
#[test]
fn changed_packs_are_read_on() {
    let reader = Reader::new();
    let pack = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus/pack/scene_stored.kdpack");
    let pack = fs::read(pack).unwrap();
    let check_changed = |old: &str, new: &str| {
        let at = pack.windows(old.len()).position(|bytes| bytes == old.as_bytes()).unwrap();
        reader.check(Format::Pack, &[&pack[..at], new.as_bytes(), &pack[at + old.len()..]].concat())
    };
    assert_eq!(check_changed("v -1 -1 0", "v -100 -1 0"), None);
    let error_of = |old: &str, new: &str| check_changed(old, new).unwrap();
    assert!(error_of("\"s.toml\"", "\"t.toml\"").contains("there is no file `t.toml`"));
    assert!(error_of("\"parts/a.obj\"", "\"parts/../a.obj\"").contains("`parts/../a.obj` is no path below the pack"));
    assert!(error_of("'parts/a.obj'", "'parts/b.obj'").contains("b.obj"));
}

#[test]
fn an_error_that_names_its_file_is_accepted() {
    for line in ["/a/file.obj:3: vertex 4 is out of range", "/a/file.obj: has no triangles"] {
        check_error(line, &[Path::new("/a/file.mtl"), Path::new("/a/file.obj")]);
    }
}

#[test]
fn other_errors_are_noticed() {
    let long = format!("/a/file.obj: {}", "x".repeat(800));
    let lines =
        ["", "has no triangles", "/a/file.obj", "/a/file.obj:3:", "/a/file.obj: two\nlines", "/b/file.obj: x", &long];
    for line in lines {
        let noticed = std::panic::catch_unwind(|| check_error(line, &[Path::new("/a/file.obj")]));
        assert!(noticed.is_err(), "{line:?} is accepted");
    }
}
