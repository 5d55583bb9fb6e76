//! Names of objects.

use std::fmt;

use object_store::path::Path;

use crate::error::StoreError;

/// A kind of store.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) enum Scheme {
    S3,
    Google,
    Azure,
    Web,
}

/// Beginnings of names, and the stores that they name.
const SCHEMES: [(&str, Scheme); 9] = [
    ("s3", Scheme::S3),
    ("s3a", Scheme::S3),
    ("gs", Scheme::Google),
    ("gcs", Scheme::Google),
    ("az", Scheme::Azure),
    ("abfs", Scheme::Azure),
    ("abfss", Scheme::Azure),
    ("http", Scheme::Web),
    ("https", Scheme::Web),
];

/// The name of an object, or of all objects that begin with it.
///
/// Displayed without the query of a web address, which may hold a signature.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Uri {
    pub(crate) scheme: Scheme,
    /// Scheme, bucket and key as written.
    text: String,
    /// Bytes of scheme and bucket.
    root: usize,
    pub(crate) query: Option<Query>,
}

/// What follows the path of a web address.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub(crate) struct Query(pub(crate) String);

impl fmt::Debug for Query {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Query")
    }
}

impl fmt::Display for Uri {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

impl Uri {
    /// Reads a name such as `s3://bucket/folder/x.wav`. Keys are taken as they stand; only web
    /// addresses have percent encoding.
    ///
    /// # Errors
    /// [`StoreError::Name`] says what is wrong.
    pub fn parse(name: &str) -> Result<Self, StoreError> {
        let wrong = |reason: String| StoreError::Name { name: without_query(name), reason };
        let Some((scheme, rest)) = scheme(name) else {
            let known: Vec<&str> = SCHEMES.iter().map(|(name, _)| *name).collect();
            let known = known.join("://, ");
            return Err(wrong(format!("must begin with one of {known}://")));
        };
        let (bucket, key) = rest.split_once('/').unwrap_or((rest, ""));
        let root = name.len() - rest.len() + bucket.len();
        if bucket.is_empty() {
            return Err(wrong("has no bucket".into()));
        }
        let is_account = scheme == Scheme::Azure;
        if scheme != Scheme::Web && (bucket.contains(':') || bucket.contains('@') && !is_account) {
            // A key and its secret would stand in messages and outputs.
            return Err(StoreError::Name {
                name: "an address in a store".into(),
                reason: "must not contain a user name, password or port".into(),
            });
        }
        // Azure's own containers are called `$web`.
        let marks = if is_account { "._-@$" } else { "._-" };
        let allowed = |c: char| c.is_ascii_alphanumeric() || marks.contains(c);
        if let Some(other) = bucket.chars().find(|c| scheme != Scheme::Web && !allowed(*c)) {
            return Err(wrong(format!(
                "has {other:?} in the name of its bucket, which no store allows"
            )));
        }
        let (key, query) = match scheme {
            Scheme::Web => {
                if bucket.contains('@') {
                    // It would stand in outputs.
                    return Err(StoreError::Name {
                        name: "a web address".into(),
                        reason: "must not contain a user name or password".into(),
                    });
                }
                let key = key.split_once('#').map_or(key, |(key, _)| key);
                match key.split_once('?') {
                    Some((key, query)) => (key, Some(Query(query.into()))),
                    None => (key, None),
                }
            }
            _ => (key, None),
        };
        let text = format!("{}/{key}", &name[..root]);
        let uri = Self { scheme, text, root, query };
        uri.path().map(|_| uri)
    }

    /// The whole name, without query.
    pub fn as_str(&self) -> &str {
        &self.text
    }

    /// The whole name, with the query of a web address. It may hold a signature: for whoever opens the
    /// object, never for messages or outputs.
    pub fn address(&self) -> String {
        match &self.query {
            Some(Query(query)) => format!("{}?{query}", self.text),
            None => self.text.clone(),
        }
    }

    /// The key of the object in its bucket, as written.
    pub fn key(&self) -> &str {
        &self.text[self.root + 1..]
    }

    /// Scheme and bucket (container, host).
    pub fn root(&self) -> &str {
        &self.text[..self.root]
    }

    /// Bucket (container, host).
    pub fn bucket(&self) -> &str {
        self.root().split_once("://").map_or("", |(_, bucket)| bucket)
    }

    /// Bucket and key.
    pub fn path_in_store(&self) -> &str {
        self.text.split_once("://").map_or("", |(_, path)| path)
    }

    /// Whether it names all objects below it: it ends with a slash, or is a whole bucket.
    pub fn is_folder(&self) -> bool {
        self.key().is_empty() || self.key().ends_with('/')
    }

    /// Whether it is the address of a file on a web server.
    pub fn is_web(&self) -> bool {
        self.scheme == Scheme::Web
    }

    /// Another object of the same bucket.
    pub fn with_key(&self, key: &str) -> Self {
        let text = format!("{}/{key}", self.root());
        Self { scheme: self.scheme, text, root: self.root, query: None }
    }

    /// The key as the store's client takes it.
    pub(crate) fn path(&self) -> Result<Path, StoreError> {
        let path = match self.scheme {
            Scheme::Web => Path::from_url_path(self.key()),
            // The client would pass over it.
            _ if self.key().starts_with('/') => {
                let reason = "has a key that begins with a slash, which is not read".into();
                return Err(StoreError::Name { name: self.to_string(), reason });
            }
            _ => Path::parse(self.key()),
        };
        path.map_err(|e| StoreError::Name { name: self.to_string(), reason: e.to_string() })
    }
}

fn scheme(name: &str) -> Option<(Scheme, &str)> {
    let (scheme, rest) = name.split_once("://")?;
    let known = SCHEMES.iter().find(|(known, _)| scheme.eq_ignore_ascii_case(known));
    known.map(|(_, scheme)| (*scheme, rest))
}

fn without_query(name: &str) -> String {
    match scheme(name) {
        Some((Scheme::Web, _)) => name.split(['?', '#']).next().unwrap_or_default().into(),
        _ => name.into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_taken_as_they_stand() {
        for key in ["a/b.wav", "a b%20ü.wav", "a?b#c.wav", "{x}[1]~.wav"] {
            let uri = Uri::parse(&format!("s3://bucket/{key}")).unwrap();
            assert_eq!((uri.bucket(), uri.key()), ("bucket", key));
            assert_eq!(uri.path().unwrap().as_ref(), key);
            assert_eq!(uri.to_string(), format!("s3://bucket/{key}"));
        }
        let azure = Uri::parse("abfss://c@account.dfs.core.windows.net/x.wav").unwrap();
        assert_eq!(
            (azure.root(), azure.key()),
            ("abfss://c@account.dfs.core.windows.net", "x.wav")
        );
    }

    #[test]
    fn web_addresses_show_no_query_and_hold_no_password() {
        let uri = Uri::parse("https://host:8/a%20b.wav?signature=secret#part").unwrap();
        assert_eq!(uri.path().unwrap().as_ref(), "a b.wav");
        assert_eq!(uri.to_string(), "https://host:8/a%20b.wav");
        assert_eq!(uri.address(), "https://host:8/a%20b.wav?signature=secret");
        assert_eq!(Uri::parse(&uri.address()).unwrap(), uri);
        assert!(!format!("{uri:?}").contains("secret"));
        for name in [
            "https://me:secret@host/x.wav",
            "https:///x.wav?secret",
            "http://h/a//b?secret",
            "s3://id:secret@bucket/x.wav",
            "s3://id:sec/ret@secret/x.wav",
            "s3://secret@bucket/x.wav",
        ] {
            let error = Uri::parse(name).unwrap_err();
            assert!(!format!("{error} {error:?}").contains("secret"), "{error:?}");
        }
    }

    #[test]
    fn azure_has_containers_of_its_own() {
        assert_eq!(Uri::parse("az://$web/x.wav").unwrap().bucket(), "$web");
        assert!(Uri::parse("s3://$web/x.wav").is_err());
    }

    #[test]
    fn names_that_no_store_has_are_refused() {
        for name in [
            "s3://",
            "s3:///x.wav",
            "s3://b/a//x.wav",
            "s3://b//x.wav",
            "s3://b/../x.wav",
            "s3://my bucket/x.wav",
            "gs://b\u{e9}/x.wav",
            "hdfs://b/x.wav",
            "file:///x.wav",
            "x.wav",
        ] {
            assert!(Uri::parse(name).is_err(), "{name}");
        }
        let folder = |name| Uri::parse(name).unwrap().is_folder();
        assert!(
            folder("s3://b") && folder("s3://b/") && folder("s3://b/x/") && !folder("s3://b/x")
        );
    }
}
