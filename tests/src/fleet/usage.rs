//! The memory and processor time of a process, as Linux counts them.

use std::time::Duration;

/// Clock ticks per second in `/proc`: the same on every Linux.
const TICKS_PER_S: f64 = 100.0;

/// Resident memory of a process, bytes; `None` when it is gone, or without `/proc`.
#[must_use]
pub fn resident_bytes(process: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<u64>().ok()? * 1024)
}

/// Processor time of a process, all its threads together.
#[must_use]
pub fn computed(process: u32) -> Option<Duration> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name, in parentheses, may contain anything.
    let after_name = stat.rsplit_once(") ")?.1;
    let mut numbers = after_name.split(' ').skip(11);
    let (user, system): (f64, f64) = (numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?);
    Some(Duration::from_secs_f64((user + system) / TICKS_PER_S))
}

/// The load average over the last minute.
#[must_use]
pub fn load() -> Option<f64> {
    std::fs::read_to_string("/proc/loadavg").ok()?.split(' ').next()?.parse().ok()
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    #[test]
    fn this_process_takes_something() {
        let me = std::process::id();
        assert!(resident_bytes(me).is_some_and(|bytes| bytes > 1 << 20));
        assert!(computed(me).is_some() && load().is_some());
    }
}
