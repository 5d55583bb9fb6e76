//! The columns with the times of stretches, and others that look like them.

use corsmal_files::quote::quoted;

/// Column of the start of a stretch, in seconds.
pub(crate) const START: &str = "start";
/// Column of the end of a stretch, in seconds.
pub(crate) const END: &str = "end";

/// What other programs call the end of a stretch that has a `start`.
const ENDS: [&str; 8] =
    ["duration", "dur", "length", "stop", "stop_time", "end_time", "offset", "offset_time"];
/// What they call the start of a stretch that has an `end`.
const STARTS: [&str; 4] = ["onset", "begin", "begin_time", "start_time"];
/// What they call either.
const EITHER: [&str; 8] =
    ["start_time", "end_time", "begin", "begin_time", "stop", "stop_time", "onset", "offset"];

/// Why stretches with these columns would be others than meant, such as all that follows a `start` where a
/// column has the duration; and where the two columns are.
pub fn times_refusal(names: &[&str]) -> Option<([usize; 2], String)> {
    let find = |name: &str| names.iter().position(|found| found.eq_ignore_ascii_case(name));
    let first_of = |names: &[&str]| names.iter().find_map(|name| find(name));
    let (one, other) = match (find(START), find(END)) {
        (None, None) => (find("onset")?, first_of(&["offset", "duration"])?),
        (Some(start), None) => (start, first_of(&ENDS)?),
        (None, Some(end)) => (first_of(&STARTS)?, end),
        (Some(_), Some(_)) => return None,
    };
    let reason = format!(
        "columns {} and {}: the times of stretches are read from columns `{START}` and `{END}`, in seconds; \
         if these are labels, give them other names",
        quoted(names[one]),
        quoted(names[other])
    );
    Some(([one, other], reason))
}

/// That these labels look like the times of stretches, where nothing is cut.
pub(super) fn unused_times<'n>(labels: impl Iterator<Item = &'n str> + Clone) -> Option<String> {
    let is_own = |name: &&str| [START, END].contains(name);
    // Those of a manifest are no labels.
    let (of_tar, remedy) = match labels.clone().any(|name| is_own(&name)) {
        true => (
            " of a tar",
            "a tar has no stretches; put the recordings into files and list them in a manifest",
        ),
        false => ("", "to read stretches, use columns called `start` and `end`, in seconds"),
    };
    let times: Vec<&str> = labels.filter(|name| is_own(name) || EITHER.contains(name)).collect();
    let columns = match times.as_slice() {
        [] => return None,
        [only] => format!("the column {only}{of_tar} is a label"),
        several => format!("the columns {}{of_tar} are labels", several.join(", ")),
    };
    Some(format!("{columns}, so whole recordings are read: {remedy}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rows with a start and a duration were read to the end of the recording.
    #[test]
    fn half_of_a_stretch_under_another_name_is_refused() {
        for names in [
            ["start", "duration"],
            ["start", "Stop"],
            ["end_time", "start"],
            ["end", "onset"],
            ["duration", "onset"],
        ] {
            let (places, reason) = times_refusal(&["path", names[0], "x", names[1]]).unwrap();
            assert!(places == [1, 3] || places == [3, 1], "{names:?}");
            assert!(reason.contains(names[0]) && reason.contains(names[1]), "{reason}");
        }
        for names in [["start", "end"], ["start", "person"], ["duration", "length"]] {
            assert_eq!(times_refusal(&["path", names[0], names[1]]), None);
        }
        assert_eq!(times_refusal(&["start", "end", "duration"]), None);
    }

    /// The JSON of a recording in a tar had them, and nothing was said.
    #[test]
    fn labels_that_look_like_times_are_said() {
        let said = |names: &[&str]| unused_times(names.iter().copied());
        assert_eq!(said(&["class", "duration"]), None);
        assert!(said(&["onset"]).unwrap().contains("the column onset is a label"));
        let tar = said(&["start", "class", "end"]).unwrap();
        assert!(tar.contains("the columns start, end of a tar are labels"), "{tar}");
    }
}
