//! The files in which the tools of AWS keep credentials.

use std::collections::HashMap;
use std::path::PathBuf;

use crate::error::StoreError;

/// What a profile says, by key.
pub(crate) type Profile = HashMap<String, String>;

/// Ways to sign in that need another program.
const SIGN_IN: [&str; 4] = ["sso_session", "sso_start_url", "credential_process", "role_arn"];

/// The profile that `AWS_PROFILE` names, from `~/.aws/credentials` and `~/.aws/config`; empty where
/// there are no such files. With `needs_keys` it must hold some, if it says how to sign in.
pub(crate) fn chosen(needs_keys: bool) -> Result<Profile, StoreError> {
    let variable = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let file = |name: &str, usual: &str| {
        variable(name).map(PathBuf::from).or_else(|| {
            let home = std::env::home_dir()?;
            Some(home.join(".aws").join(usual))
        })
    };
    let text = |path: Option<PathBuf>| {
        path.and_then(|path| std::fs::read_to_string(path).ok()).unwrap_or_default()
    };
    let asked = variable("AWS_PROFILE");
    let credentials = text(file("AWS_SHARED_CREDENTIALS_FILE", "credentials"));
    let config = text(file("AWS_CONFIG_FILE", "config"));
    of(asked.as_deref(), needs_keys, &credentials, &config)
}

fn of(
    asked: Option<&str>,
    needs_keys: bool,
    credentials: &str,
    config: &str,
) -> Result<Profile, StoreError> {
    let name = asked.unwrap_or("default");
    // Only the profile `default` goes without the word in the configuration.
    let plain = (name == "default").then(|| section_of(config, name)).flatten();
    let configured = plain.or_else(|| section_of(config, &format!("profile {name}")));
    let kept = section_of(credentials, name);
    let found = configured.is_some() || kept.is_some();
    // What stands in the file of credentials counts more.
    let mut profile = configured.unwrap_or_default();
    profile.extend(kept.unwrap_or_default());
    if let (Some(name), false) = (asked, found) {
        return Err(StoreError::Setup(format!("AWS_PROFILE = {name}: there is no such profile")));
    }
    if needs_keys
        && !profile.contains_key("aws_access_key_id")
        && let Some(way) = SIGN_IN.iter().find(|key| profile.contains_key(**key))
    {
        return Err(StoreError::Setup(format!(
            "the profile {name} signs in by {way}, which this program cannot do: run eval \"$(aws \
             configure export-credentials --profile {name} --format env)\" first"
        )));
    }
    Ok(profile)
}

/// Keys and values of a section.
fn section_of(text: &str, section: &str) -> Option<Profile> {
    let mut values: Option<Profile> = None;
    let mut inside = false;
    for line in text.lines() {
        let trimmed = line.trim();
        if trimmed.starts_with(['#', ';']) {
            continue;
        }
        if let Some(name) = trimmed.strip_prefix('[').and_then(|rest| rest.split(']').next()) {
            inside = name.split_whitespace().eq(section.split_whitespace());
            if inside {
                values.get_or_insert_default();
            }
        } else if let (true, Some(values), Some((key, value))) =
            (inside && !line.starts_with([' ', '\t']), values.as_mut(), trimmed.split_once('='))
        {
            values.insert(key.trim().to_ascii_lowercase(), value.trim().to_owned());
        }
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    const CREDENTIALS: &str = "[default]\naws_access_key_id = A\naws_secret_access_key=B=\n\n[lab]\n\
                               # old\naws_access_key_id=C\naws_secret_access_key=D\n";
    const CONFIG: &str = "[default]\nregion=eu-west-1\n[profile lab]\nregion = eu-north-1\ns3 =\n  \
                          region = nested\n[profile staff]\nsso_session = x\n[lab]\nregion = other\n";

    #[test]
    fn both_files_make_a_profile() {
        let of = |name| of(name, true, CREDENTIALS, CONFIG).unwrap();
        let default = of(None);
        assert_eq!(default["aws_secret_access_key"], "B=");
        assert_eq!(default["region"], "eu-west-1");
        let lab = of(Some("lab"));
        assert_eq!(
            (lab["aws_access_key_id"].as_str(), lab["region"].as_str()),
            ("C", "eu-north-1")
        );
        assert!(super::of(None, true, "", "").unwrap().is_empty());
    }

    #[test]
    fn profiles_that_are_not_there_or_need_a_program_are_told() {
        let told = |name| of(Some(name), true, CREDENTIALS, CONFIG).unwrap_err().to_string();
        assert!(told("nobody").contains("no such profile"));
        assert!(
            told("staff").contains("sso_session") && told("staff").contains("export-credentials")
        );
    }
}
