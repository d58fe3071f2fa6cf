//! The check that files which a scene's file names lie below its folder, so that a scene from elsewhere cannot show
//! other files of the computer.

use std::{
    fs,
    path::{Component, Path, PathBuf},
};

use super::error::Checked;

/// Returns the path of a file that another file names. `folder` is the folder of the file that names it.
///
/// The path of a file that does not exist is returned, too: reading it fails.
///
/// # Errors
/// The name is empty, absolute, contains `..` or is a URI with a scheme, or a symbolic link leads out of the folder.
pub(super) fn below(folder: &Path, name: &str) -> Checked<PathBuf> {
    check_name(name)?;
    let path = folder.join(name);
    let Ok(found) = fs::canonicalize(&path) else { return Ok(path) };
    let root = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    match fs::canonicalize(root) {
        Ok(root) if found.starts_with(&root) => Ok(path),
        _ => Err(format!("`{name}` leads out of the folder of the file that names it")),
    }
}

/// Refuses names that are no relative paths into the folder, whether their files exist or not.
fn check_name(name: &str) -> Checked<()> {
    if name.is_empty() {
        return Err("the name of a file is empty".to_owned());
    }
    if let Some(scheme) = scheme(name) {
        return Err(format!("`{name}` is not a relative path: files with `{scheme}:` are not read"));
    }
    let is_inside = |part| matches!(part, Component::Normal(_) | Component::CurDir);
    let is_windows_path = name.starts_with('\\') || name.split('\\').any(|part| part == "..");
    if Path::new(name).components().all(is_inside) && !is_windows_path {
        Ok(())
    } else {
        Err(format!("`{name}` is not below the folder of the file that names it"))
    }
}

/// Returns the scheme of a URI, or the letter of a drive.
fn scheme(name: &str) -> Option<&str> {
    let (scheme, _) = name.split_once(':')?;
    let is_scheme = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
        && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
    is_scheme.then_some(scheme)
}

#[cfg(test)]
mod tests {
    use tempfile::TempDir;

    use super::*;

    #[test]
    fn only_names_below_the_folder_are_allowed() {
        let directory = TempDir::new().unwrap();
        let folder = directory.path().join("scene");
        fs::create_dir_all(folder.join("parts")).unwrap();
        fs::write(directory.path().join("secret"), "").unwrap();
        fs::write(folder.join("parts/a"), "").unwrap();
        for name in ["parts/a", "./parts/a", "none", "parts/none", "a b.png", "Größe:1"] {
            assert_eq!(below(&folder, name).unwrap(), folder.join(name), "{name}");
        }
        let absolute = directory.path().join("secret");
        let absolute = absolute.to_str().unwrap();
        for name in [
            "",
            "../secret",
            "parts/../../secret",
            "parts/../parts/a",
            absolute,
            "/etc/none",
            "file:///etc/passwd",
            "http://host/a",
            "C:\\a",
            "..\\secret",
            "\\\\host\\a",
            "a\\..\\b",
        ] {
            assert!(below(&folder, name).is_err(), "{name}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn links_must_not_lead_out() {
        let directory = TempDir::new().unwrap();
        let folder = directory.path().join("scene");
        fs::create_dir(&folder).unwrap();
        fs::write(directory.path().join("secret"), "").unwrap();
        fs::write(folder.join("a"), "").unwrap();
        std::os::unix::fs::symlink("../secret", folder.join("out")).unwrap();
        std::os::unix::fs::symlink("..", folder.join("up")).unwrap();
        std::os::unix::fs::symlink("a", folder.join("in")).unwrap();
        assert!(below(&folder, "in").is_ok());
        assert!(below(&folder, "out").unwrap_err().contains("leads out"));
        assert!(below(&folder, "up/secret").unwrap_err().contains("leads out"));
    }
}
