//! Clients of stores, one for each bucket.

use std::collections::HashMap;
use std::str::FromStr;
use std::sync::{Arc, Mutex, Once};
use std::time::Duration;

use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::azure::{AzureConfigKey, MicrosoftAzureBuilder};
use object_store::client::{HttpClient, HttpConnector, ReqwestConnector};
use object_store::gcp::{GoogleCloudStorageBuilder, GoogleConfigKey};
use object_store::http::HttpBuilder;
use object_store::{BackoffConfig, ClientConfigKey, ClientOptions, ObjectStore, RetryConfig};

use crate::error::StoreError;
use crate::profile;
use crate::runtime;
use crate::uri::{Scheme, Uri};

/// Time for one range, so that slow lines of 40 KB/s get through, and time without a byte.
const TIMES: [(ClientConfigKey, &str); 2] =
    [(ClientConfigKey::Timeout, "120 seconds"), (ClientConfigKey::ReadTimeout, "20 seconds")];

/// The process, and its clients by the root of their objects.
type Clients = HashMap<String, Arc<dyn ObjectStore>>;
static CLIENTS: Mutex<Option<(u32, Clients)>> = Mutex::new(None);

/// The client of an object's store.
pub(crate) fn store(uri: &Uri) -> Result<Arc<dyn ObjectStore>, StoreError> {
    if let Some(query) = &uri.query {
        // Signed addresses are as many as objects: their clients share connections and are not kept.
        return web(uri, Some(&query.0));
    }
    if let Some(store) = with_clients(|clients| clients.get(uri.root()).cloned())? {
        return Ok(store);
    }
    let store = connect(uri)?;
    with_clients(|clients| clients.entry(uri.root().to_owned()).or_insert(store).clone())
}

fn with_clients<T>(work: impl FnOnce(&mut Clients) -> T) -> Result<T, StoreError> {
    let process = std::process::id();
    let mut kept = runtime::lock(&CLIENTS)?;
    let (mut owner, mut clients) = kept.take().unwrap_or_else(|| (process, Clients::new()));
    if owner != process {
        // Those of the parent of a fork: their connections are the parent's.
        std::mem::forget(std::mem::take(&mut clients));
        owner = process;
    }
    let found = work(&mut clients);
    *kept = Some((owner, clients));
    Ok(found)
}

fn connect(uri: &Uri) -> Result<Arc<dyn ObjectStore>, StoreError> {
    cryptography();
    let store: Arc<dyn ObjectStore> = match uri.scheme {
        Scheme::S3 => Arc::new(amazon(uri)?.build().map_err(setup)?),
        Scheme::Google => {
            let mut builder = GoogleCloudStorageBuilder::new().with_bucket_name(uri.bucket());
            if let Some(path) = std::env::var("SERVICE_ACCOUNT").ok().filter(|p| !p.is_empty()) {
                builder = builder.with_service_account_path(path);
            }
            for (key, value) in environment("GOOGLE_")? {
                builder = builder.with_config(key, value);
            }
            if let Some(address) = builder.get_config_value(&GoogleConfigKey::BaseUrl) {
                require_address("GOOGLE_BASE_URL", &address)?;
            }
            for (key, value) in TIMES {
                builder = builder.with_config(GoogleConfigKey::Client(key), value);
            }
            Arc::new(builder.with_retry(retry()).build().map_err(setup)?)
        }
        Scheme::Azure => {
            let mut builder = MicrosoftAzureBuilder::new().with_url(uri.root());
            for (key, value) in environment("AZURE_")? {
                builder = builder.with_config(key, value);
            }
            if let Some(to) = std::env::var("IDENTITY_ENDPOINT").ok().filter(|to| !to.is_empty()) {
                builder = builder.with_msi_endpoint(to);
            }
            if let Some(address) = builder.get_config_value(&AzureConfigKey::Endpoint) {
                require_address("AZURE_STORAGE_ENDPOINT", &address)?;
            }
            for (key, value) in TIMES {
                builder = builder.with_config(AzureConfigKey::Client(key), value);
            }
            Arc::new(builder.with_retry(retry()).build().map_err(setup)?)
        }
        Scheme::Web => return web(uri, None),
    };
    Ok(store)
}

fn amazon(uri: &Uri) -> Result<AmazonS3Builder, StoreError> {
    use AmazonS3ConfigKey as Key;
    let mut builder = AmazonS3Builder::new().with_bucket_name(uri.bucket()).with_retry(retry());
    for (key, value) in environment("AWS_")? {
        builder = builder.with_config(key, value);
    }
    let set = |builder: &AmazonS3Builder, key| builder.get_config_value(&key).is_some();
    let has_role = set(&builder, Key::WebIdentityTokenFile) && set(&builder, Key::RoleArn);
    let unsigned = builder.get_config_value(&Key::SkipSignature).is_some_and(|v| is_yes(&v));
    let needs_keys = !set(&builder, Key::AccessKeyId) && !has_role && !unsigned;
    let profile = profile::chosen(needs_keys)?;
    for (name, key, is_wanted) in [
        ("aws_access_key_id", Key::AccessKeyId, needs_keys),
        ("aws_secret_access_key", Key::SecretAccessKey, needs_keys),
        ("aws_session_token", Key::Token, needs_keys),
        ("region", Key::Region, true),
        ("endpoint_url", Key::Endpoint, true),
    ] {
        if let (Some(value), true) = (profile.get(name), is_wanted && !set(&builder, key)) {
            builder = builder.with_config(key, value);
        }
    }
    let endpoint = [Key::S3Endpoint, Key::Endpoint].map(|key| builder.get_config_value(&key));
    if let Some(endpoint) = endpoint.iter().flatten().next() {
        require_address("AWS_ENDPOINT_URL, or endpoint_url of the profile,", endpoint)?;
        // Whoever names an endpoint without encryption wants it.
        if endpoint.starts_with("http://") {
            builder = builder.with_config(Key::Client(ClientConfigKey::AllowHttp), "true");
        }
    }
    let region = builder.get_config_value(&Key::Region).unwrap_or_default();
    if !region.chars().all(|c| c.is_ascii_alphanumeric() || "-_.".contains(c)) {
        return Err(StoreError::Setup(format!(
            "AWS_REGION or AWS_DEFAULT_REGION, or region of the profile, must be a name such as us-east-1, not {region:?}"
        )));
    }
    for (key, value) in TIMES {
        builder = builder.with_config(Key::Client(key), value);
    }
    Ok(builder)
}

/// Settings of a store in the environment, whose names begin with `prefix`. Variables without a value count as absent,
/// as AWS's own tools have it.
///
/// # Errors
/// A value that no request can carry: the client panics at it.
fn environment<K: FromStr>(prefix: &str) -> Result<Vec<(K, String)>, StoreError> {
    let mut found = Vec::new();
    for (name, value) in std::env::vars_os() {
        let (Some(name), Some(value)) = (name.to_str(), value.to_str()) else { continue };
        let key = name.starts_with(prefix).then(|| name.to_ascii_lowercase().parse().ok());
        let Some(key) = key.flatten().filter(|_| !value.is_empty()) else { continue };
        // A JSON text.
        let is_key = name == "GOOGLE_SERVICE_ACCOUNT_KEY";
        if value.contains(char::is_control) && !is_key {
            return Err(StoreError::Setup(format!(
                "{name} holds a control character, such as a line feed at its end: set it without"
            )));
        }
        found.push((key, value.to_owned()));
    }
    Ok(found)
}

/// Refuses an endpoint that is no address: the client panics at it. It may hold a password, which nothing shows.
fn require_address(named_by: &str, endpoint: &str) -> Result<(), StoreError> {
    let has_host = |uri: http::Uri| uri.host().is_some_and(|host| !host.is_empty());
    let is_url = reqwest::Url::parse(endpoint).is_ok_and(|url| url.scheme().starts_with("http"));
    match is_url && endpoint.parse().is_ok_and(has_host) {
        true => Ok(()),
        false => Err(StoreError::Setup(format!(
            "{named_by} must be an address with http:// or https://, such as http://localhost:9000"
        ))),
    }
}

/// Whether a setting is on, in the words that the client knows.
fn is_yes(value: &str) -> bool {
    ["1", "true", "on", "yes", "y"].contains(&value.to_ascii_lowercase().as_str())
}

fn web(uri: &Uri, query: Option<&str>) -> Result<Arc<dyn ObjectStore>, StoreError> {
    cryptography();
    let root = match query {
        Some(query) => format!("{}/?{query}", uri.root()),
        None => uri.root().to_owned(),
    };
    let builder = HttpBuilder::new().with_url(root).with_http_connector(Shared);
    Ok(Arc::new(builder.with_retry(retry()).build().map_err(setup)?))
}

/// Web servers share one pool of connections.
#[derive(Debug)]
struct Shared;

static WEB: Mutex<Option<(u32, HttpClient)>> = Mutex::new(None);

impl HttpConnector for Shared {
    fn connect(&self, _: &ClientOptions) -> object_store::Result<HttpClient> {
        let process = std::process::id();
        let mut kept = runtime::lock(&WEB).map_err(|error| object_store::Error::Generic {
            store: "HTTP",
            source: error.into(),
        })?;
        if let Some((_, client)) = kept.as_ref().filter(|(owner, _)| *owner == process) {
            return Ok(client.clone());
        }
        let client = ReqwestConnector::default().connect(&options().with_allow_http(true))?;
        std::mem::forget(kept.replace((process, client.clone())));
        Ok(client)
    }
}

fn options() -> ClientOptions {
    TIMES
        .into_iter()
        .fold(ClientOptions::new(), |options, (key, value)| options.with_config(key, value))
}

/// What the client repeats by itself: requests that got no answer, or one to come again. Ranges whose
/// bytes break off are repeated by the reader.
fn retry() -> RetryConfig {
    RetryConfig {
        backoff: BackoffConfig { max_backoff: Duration::from_secs(5), ..BackoffConfig::default() },
        max_retries: 3,
        retry_timeout: Duration::from_secs(60),
    }
}

/// Chooses who encrypts, once in a process.
fn cryptography() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        // Where the program that uses this crate has chosen already, that counts.
        let _ = rustls::crypto::ring::default_provider().install_default();
    });
}

fn setup(error: object_store::Error) -> StoreError {
    match StoreError::from(error) {
        StoreError::Failed(reason) => StoreError::Setup(reason),
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The client panicked in a thread, and the message was that a request had ended.
    #[test]
    fn endpoints_are_addresses() {
        for good in ["http://localhost:9000", "https://s3.example.org/", "http://[::1]:5000"] {
            assert_eq!(require_address("X", good), Ok(()), "{good}");
        }
        for bad in [
            "localhost:9000",
            "",
            "http://",
            "http://my host",
            "ftp://host",
            "http://[",
            "http://h:99999",
            "http://a%zz",
            "http://\u{e9}",
            "http://a|b",
            "http://?",
        ] {
            let said = require_address("X", bad).unwrap_err().to_string();
            assert!(said.starts_with("X must be an address with http://"), "{bad}: {said}");
        }
    }
}
