//! The CPU cores that the process sees, and the quota of their time that its control group has.

use std::{fs, path::Path};

use serde::Serialize;

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Cpus {
    /// Number of cores that the process may run on. `None` if the system does not tell.
    pub cores: Option<usize>,
    /// Number of cores whose time the process may use. `None` without a quota.
    pub quota: Option<f64>,
}

impl Cpus {
    /// Returns what the files below `root` say of this process.
    pub fn gather(root: &Path) -> Self {
        Self { cores: cores(root), quota: quota(root) }
    }
}

fn cores(root: &Path) -> Option<usize> {
    let status = fs::read_to_string(root.join("proc/self/status")).ok()?;
    let list = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:"))?;
    let n_of = |range: &str| {
        let (first, last) = range.split_once('-').unwrap_or((range, range));
        Some(last.parse::<usize>().ok()? + 1 - first.parse::<usize>().ok()?)
    };
    list.trim().split(',').map(n_of).sum()
}

/// Returns the least quota of the control groups that the process is in, and of those around them.
fn quota(root: &Path) -> Option<f64> {
    let groups = fs::read_to_string(root.join("proc/self/cgroup")).ok()?;
    let quotas = groups.lines().flat_map(|line| {
        let mut fields = line.splitn(3, ':').skip(1);
        let (controllers, path) = (fields.next().unwrap_or_default(), fields.next().unwrap_or_default());
        let is_of_cpu = controllers.split(',').any(|controller| controller == "cpu");
        // Version 2 has one group for all controllers, without a name.
        let folders: &[&str] = match controllers {
            "" => &["sys/fs/cgroup"],
            _ if is_of_cpu => &["sys/fs/cgroup/cpu", "sys/fs/cgroup/cpu,cpuacct"],
            _ => &[],
        };
        let groups = Path::new(path.trim_start_matches('/')).ancestors();
        let folders = groups.flat_map(|group| folders.iter().map(move |folder| root.join(folder).join(group)));
        folders.filter_map(|folder| quota_of(&folder)).collect::<Vec<_>>()
    });
    quotas.reduce(f64::min)
}

/// Returns the quota of a control group of version 1 or 2.
fn quota_of(folder: &Path) -> Option<f64> {
    let read = |name: &str| fs::read_to_string(folder.join(name)).ok();
    let (quota, period) = match read("cpu.max") {
        Some(text) => text.trim().split_once(' ').map(|(quota, period)| (quota.to_owned(), period.to_owned()))?,
        None => (read("cpu.cfs_quota_us")?, read("cpu.cfs_period_us")?),
    };
    // Without a quota, version 2 says `max`, and version 1 says -1.
    let number = |text: String| text.trim().parse::<f64>().ok().filter(|number| *number > 0.0);
    Some(number(quota)? / number(period)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(files: &[(&str, &str)]) -> Cpus {
        let root = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = root.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        Cpus::gather(root.path())
    }

    #[test]
    fn quotas_of_both_versions() {
        let status = ("proc/self/status", "Name:\tx\nCpus_allowed_list:\t0-3,8,10-11\n");
        assert_eq!(found(&[status]), Cpus { cores: Some(7), quota: None });
        let v2 = ("proc/self/cgroup", "0::/a/b\n");
        let max = |quota| [v2, ("sys/fs/cgroup/a/cpu.max", quota), ("sys/fs/cgroup/a/b/cpu.max", "max 100000\n")];
        assert_eq!(found(&max("250000 100000\n")).quota, Some(2.5));
        assert_eq!(found(&max("max 100000\n")).quota, None);
        let v1 = ("proc/self/cgroup", "9:name=systemd:/\n3:cpu,cpuacct:/docker/1\n2:cpuset:/\n");
        let of_v1 = |quota| {
            // In a container, the group is the root of what it sees.
            let files = ["sys/fs/cgroup/cpu,cpuacct/cpu.cfs_quota_us", "sys/fs/cgroup/cpu,cpuacct/cpu.cfs_period_us"];
            [v1, (files[0], quota), (files[1], "100000\n")]
        };
        assert_eq!(found(&of_v1("50000\n")).quota, Some(0.5));
        assert_eq!(found(&of_v1("-1\n")).quota, None);
        assert_eq!(found(&[]), Cpus::default());
    }
}
