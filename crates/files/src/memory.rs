//! Memory that is free, as the system's own files say, and freed memory that is kept.

use std::fs;
use std::path::{Path, PathBuf};

/// The largest block that the GNU C library may take as a sign (32 MiB), less what it adds.
const BLOCK: usize = (32 << 20) - (64 << 10);

/// Has the GNU C library keep freed memory for the next recording or call: without it, every large buffer
/// goes back to the system when it is freed, and its pages are cleared again for the next one (a tenth to
/// a quarter of a run). That library keeps blocks up to the size of the largest that was freed; this frees
/// one that is never touched and takes no memory. Other allocators take no notice.
pub fn keep_freed() {
    drop(std::hint::black_box(Vec::<u8>::with_capacity(BLOCK)));
}

/// Bytes that can be had without swapping, within the limits of the control groups in which this
/// process runs, as containers and batch systems set them; `None` where the system does not say (it
/// does on Linux).
pub fn available() -> Option<u64> {
    let text = fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let free = line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)?;
    let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    Some(of_groups(&groups, Path::new("/sys/fs/cgroup")).map_or(free, |left| left.min(free)))
}

/// What the groups leave, by the lines of `/proc/self/cgroup`; `None` without a limit.
fn of_groups(groups: &str, root: &Path) -> Option<u64> {
    let left = groups.lines().filter_map(|line| {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, group) = (parts.next()?, parts.next()?);
        let (root, limit, used, cache) = match controllers {
            "" => (root.into(), "memory.max", "memory.current", "inactive_file"),
            _ if controllers.split(',').any(|name| name == "memory") => (
                root.join("memory"),
                "memory.limit_in_bytes",
                "memory.usage_in_bytes",
                "total_inactive_file",
            ),
            _ => return None,
        };
        let group: PathBuf = root.join(group.trim_start_matches('/'));
        // A container sees its own group as the root; the limits of all groups above count, too.
        let all = group.ancestors().take_while(|folder| folder.starts_with(&root));
        all.filter_map(|folder| left(folder, [limit, used], cache)).min()
    });
    left.min()
}

/// What one group leaves. Pages of files that nobody uses are given back.
fn left(folder: &Path, [limit, used]: [&str; 2], cache: &str) -> Option<u64> {
    let number =
        |name: &str| fs::read_to_string(folder.join(name)).ok()?.trim().parse::<u64>().ok();
    let (limit, used) = (number(limit)?, number(used)?);
    let statistics = fs::read_to_string(folder.join("memory.stat")).unwrap_or_default();
    let given_back = statistics.lines().find_map(|line| {
        let (name, value) = line.split_once(' ')?;
        if name == cache { value.parse::<u64>().ok() } else { None }
    });
    Some(limit.saturating_sub(used.saturating_sub(given_back.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(root: &Path, files: &[(&str, &str)]) {
        for (name, text) in files {
            let path = root.join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
    }

    #[test]
    fn the_narrowest_group_counts() {
        let root = tempfile::tempdir().unwrap();
        let root = root.path();
        write(
            root,
            &[
                ("memory.max", "max\n"),
                ("slurm/memory.max", "8000\n"),
                ("slurm/memory.current", "3000\n"),
                ("slurm/job_1/memory.max", "2000\n"),
                ("slurm/job_1/memory.current", "1500\n"),
                ("slurm/job_1/memory.stat", "anon 1\ninactive_file 400\n"),
                ("slurm/job_1/step/memory.max", "max\n"),
                ("memory/memory.limit_in_bytes", "9223372036854771712\n"),
                ("memory/memory.usage_in_bytes", "100\n"),
                ("memory/job/memory.limit_in_bytes", "700\n"),
                ("memory/job/memory.usage_in_bytes", "900\n"),
                ("memory/job/memory.stat", "total_inactive_file 300\n"),
            ],
        );
        assert_eq!(of_groups("0::/slurm/job_1/step\n", root), Some(900));
        assert_eq!(of_groups("0::/slurm\n", root), Some(5000));
        assert_eq!(of_groups("0::/\n", root), None);
        assert_eq!(of_groups("5:cpu:/slurm\n4:hugetlb,memory:/job\n", root), Some(100));
        assert_eq!(of_groups("4:memory:/job/inside\n0::/slurm/job_1\n", root), Some(100));
        assert_eq!(of_groups("", root), None);
        assert_eq!(of_groups("no group\n0::/../../etc\n", root), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn linux_says_what_is_free() {
        assert!(available().is_some_and(|free| free > 1 << 20));
    }
}
