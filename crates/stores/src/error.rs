//! What can go wrong with an object or its store.

use std::error::Error;
use std::io;

/// What can go wrong with an object or its store. No message holds credentials or signatures.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum StoreError {
    /// A name that no object can have.
    #[error("{name} {reason}")]
    Name {
        /// The name.
        name: String,
        /// Why.
        reason: String,
    },
    /// Nothing has this name.
    #[error("the store has no such object")]
    Missing,
    /// The store denies access.
    #[error("the store denied access: {0}")]
    Refused(String),
    /// The client cannot be set up.
    #[error("{0}")]
    Setup(String),
    /// The object is not the one that was read before.
    #[error("{0} while it was read")]
    Changed(String),
    /// The request failed, and so did every further try.
    #[error("the store failed: {0}")]
    Failed(String),
    /// The range lies after the end of the object.
    #[error("the object ends before the requested bytes")]
    Beyond,
    /// The server cannot do what is needed.
    #[error("{0}")]
    Unsupported(String),
    /// The object is there, and must not be replaced.
    #[error("the object exists")]
    Exists,
    /// The file to be sent cannot be read.
    #[error("{0}")]
    File(String),
    /// The caller asked to stop.
    #[error("interrupted")]
    Stopped,
}

/// Where credentials are looked for.
const NO_CREDENTIALS: &str = "no credentials found: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, GOOGLE_APPLICATION_CREDENTIALS \
     or AZURE_STORAGE_* in the environment; for a public bucket set AWS_SKIP_SIGNATURE=true, \
     GOOGLE_SKIP_SIGNATURE=true or AZURE_SKIP_SIGNATURE=true";
/// Addresses that machines of a cloud get credentials from, and variables that name others.
const METADATA: [&str; 3] = ["169.254.169.254", "169.254.170.2", "metadata.google.internal"];
const ELSEWHERE: [&str; 2] = ["AWS_METADATA_ENDPOINT", "AWS_CONTAINER_CREDENTIALS_FULL_URI"];

/// Answers of a server that is asked too early or too often.
const LATER: [&str; 2] = ["408 ", "429 "];

/// Codes of stores for a bucket that is not there.
const NO_BUCKET: [&str; 2] = ["(NoSuchBucket)", "(ContainerNotFound)"];

impl StoreError {
    /// Whether the next try may bring what this one did not.
    pub(crate) fn is_worth_another_try(&self) -> bool {
        matches!(self, Self::Failed(_))
    }
}

impl From<object_store::Error> for StoreError {
    fn from(error: object_store::Error) -> Self {
        use object_store::Error as E;
        match &error {
            E::NotFound { .. } => Self::Missing,
            E::AlreadyExists { .. } => Self::Exists,
            E::Precondition { .. } | E::NotModified { .. } => {
                Self::Changed("was replaced by another object".into())
            }
            E::PermissionDenied { .. } | E::Unauthenticated { .. } => Self::Refused(words(&error)),
            E::NotSupported { .. } => Self::Unsupported(
                "the server does not support range requests: download the file".into(),
            ),
            _ if is_of_credentials(&error.to_string()) => Self::Setup(NO_CREDENTIALS.into()),
            // Names that are given are looked at before: this one is of a listing.
            E::InvalidPath { source } => Self::Unsupported(format!(
                "the listing has a key that cannot be read ({source}): list a folder without it, or name the objects in a \
                 manifest"
            )),
            _ => match words(&error) {
                answer if NO_BUCKET.iter().any(|code| answer.ends_with(code)) => {
                    Self::Setup("the store has no such bucket".into())
                }
                // The second is what the client finds itself.
                answer if answer.starts_with("416 ") || answer.starts_with("Wanted range") => {
                    Self::Beyond
                }
                // Asking again changes nothing, but for answers that say so.
                answer
                    if answer.starts_with('4') && !LATER.iter().any(|l| answer.starts_with(l)) =>
                {
                    Self::Refused(answer)
                }
                answer => Self::Failed(answer),
            },
        }
    }
}

/// Whether an error is of the request for credentials, not of the one for an object.
fn is_of_credentials(text: &str) -> bool {
    let named = ELSEWHERE.iter().filter_map(|name| std::env::var(name).ok());
    let mut named = named.filter(|address| !address.is_empty());
    // Not the beginning of another address, such as one of more digits.
    let holds = |address: &str| {
        let mut behind = text.match_indices(address).map(|(at, _)| &text[at + address.len()..]);
        behind.any(|rest| !rest.starts_with(|c: char| c.is_ascii_alphanumeric()))
    };
    METADATA.iter().any(|host| holds(host)) || named.any(|address| holds(&address))
}

impl From<StoreError> for io::Error {
    fn from(error: StoreError) -> Self {
        let kind = match error {
            StoreError::Missing => io::ErrorKind::NotFound,
            StoreError::Refused(_) => io::ErrorKind::PermissionDenied,
            StoreError::Unsupported(_) => io::ErrorKind::Unsupported,
            _ => io::ErrorKind::Other,
        };
        Self::new(kind, error)
    }
}

/// The last cause of an error. What servers answer may repeat the request with its signature and token:
/// of that only the status and the code count.
fn words(error: &object_store::Error) -> String {
    let mut cause: &dyn Error = error;
    while let Some(next) = cause.source() {
        cause = next;
    }
    let text = cause.to_string();
    let code = between(&text, "<Code>", "</Code>").filter(|code| code.len() < 80);
    let (_, answer) = text.split_once("status code: ").unwrap_or(("", &text));
    let status = answer.split([':', '<', '\n', '?']).next().unwrap_or_default().trim();
    match code {
        Some(code) if text.contains("status code: ") => format!("{status} ({code})"),
        Some(code) => code.to_owned(),
        None => status.to_owned(),
    }
}

fn between<'t>(text: &'t str, before: &str, after: &str) -> Option<&'t str> {
    text.split_once(before)?.1.split_once(after).map(|(found, _)| found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(text: &str) -> String {
        words(&object_store::Error::Generic { store: "S3", source: text.into() })
    }

    #[test]
    fn answers_of_servers_are_told_without_what_was_sent() {
        let body = "<?xml version=\"1.0\"?><Error><Code>SignatureDoesNotMatch</Code><StringToSign>secret\
                    </StringToSign></Error>";
        let text = format!("Server returned non-2xx status code: 403 Forbidden: {body}");
        assert_eq!(of(&text), "403 Forbidden (SignatureDoesNotMatch)");
        assert_eq!(of(&format!("Server returned error response: {body}")), "SignatureDoesNotMatch");
        assert_eq!(
            of("Server returned non-2xx status code: 404 Not Found: secret"),
            "404 Not Found"
        );
        assert_eq!(of("http get /x.wav?signature=secret"), "http get /x.wav");
        assert_eq!(of("Connection refused (os error 111)"), "Connection refused (os error 111)");
        let is_refused = |answer: &str| {
            let source = format!("Server returned non-2xx status code: {answer}: x").into();
            let error = object_store::Error::Generic { store: "S3", source };
            matches!(StoreError::from(error), StoreError::Refused(_))
        };
        let source =
            "Server returned non-2xx status code: 404 Not Found: <Code>NoSuchBucket</Code>";
        let error = object_store::Error::Generic { store: "S3", source: source.into() };
        assert_eq!(StoreError::from(error).to_string(), "the store has no such bucket");
        assert!(is_refused("404 Not Found") && is_refused("400 Bad Request"));
        assert!(!is_refused("429 Too Many Requests") && !is_refused("503 Slow Down"));
    }
}
