//! A store on the loopback: the part of S3 that reading and writing whole objects need, and a web server,
//! failing as told.

use std::collections::{BTreeMap, HashMap, VecDeque};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::Command;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use super::listing::{decoded, etag, listing};
use crate::command::tool;

/// What happens to the answer to a GET of an object.
#[derive(Debug, Clone)]
pub enum Fault {
    /// Half of the bytes, then the connection ends.
    Broken,
    /// The bytes trickle.
    Slow,
    /// 503, to come again.
    Busy,
    /// 403, with what a store tells of the request.
    Denied,
    /// The object is replaced by this one, before the answer.
    Replaced(Vec<u8>),
    /// No answer comes.
    Silent,
    /// The answer takes its time.
    Late(Duration),
}

#[derive(Default)]
struct State {
    objects: BTreeMap<String, Vec<u8>>,
    faults: HashMap<String, VecDeque<Fault>>,
    /// Method, key and range of each request for an object.
    asked: Vec<String>,
    unsigned: usize,
    /// Parts of objects that are not complete, by the number of the upload.
    uploads: BTreeMap<String, BTreeMap<usize, Vec<u8>>>,
    begun: usize,
    /// Requests that are answered now, and the most at a time.
    open: usize,
    most_open: usize,
}

/// The server; its objects are `bucket/key`.
#[derive(Clone)]
pub struct Loopback {
    state: Arc<Mutex<State>>,
    address: String,
}

impl Loopback {
    pub fn start() -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let server = Self { state: Arc::default(), address };
        let serving = server.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let server = serving.clone();
                std::thread::spawn(move || server.serve(stream));
            }
        });
        server
    }

    pub fn put(&self, key: &str, bytes: &[u8]) {
        self.state.lock().unwrap().objects.insert(key.into(), bytes.into());
    }

    pub fn get(&self, key: &str) -> Option<Vec<u8>> {
        self.state.lock().unwrap().objects.get(key).cloned()
    }

    /// Uploads of parts that were neither completed nor given up.
    pub fn uploads(&self) -> usize {
        self.state.lock().unwrap().uploads.len()
    }

    /// The most requests that were answered at the same time since [`Loopback::asked`].
    pub fn most_at_once(&self) -> usize {
        self.state.lock().unwrap().most_open
    }

    /// Faults of the next answers to GET of a key; those of other methods as `HEAD key`, `PUT key`.
    pub fn fail(&self, key: &str, faults: &[Fault]) {
        let queue = faults.iter().cloned().collect();
        self.state.lock().unwrap().faults.insert(key.into(), queue);
    }

    /// What was asked for since the last call.
    pub fn asked(&self) -> Vec<String> {
        let mut state = self.state.lock().unwrap();
        state.most_open = state.open;
        std::mem::take(&mut state.asked)
    }

    /// Requests to S3 without a signature.
    pub fn unsigned(&self) -> usize {
        self.state.lock().unwrap().unsigned
    }

    /// The address of a file of the web server.
    pub fn web(&self, key: &str) -> String {
        format!("http://{}/web/{key}", self.address)
    }

    /// The command, which knows this store.
    pub fn tool(&self) -> Command {
        let mut command = tool();
        for (name, _) in std::env::vars().filter(|(name, _)| name.starts_with("AWS_")) {
            command.env_remove(name);
        }
        command
            .env("AWS_ENDPOINT_URL", format!("http://{}", self.address))
            .env("AWS_ACCESS_KEY_ID", "the-key-id")
            .env("AWS_SECRET_ACCESS_KEY", "the-secret-key")
            .env("AWS_SESSION_TOKEN", "the-session-token")
            .env("AWS_REGION", "eu-west-1")
            .env("no_proxy", "127.0.0.1");
        command
    }

    fn serve(&self, mut stream: TcpStream) {
        let mut lines = BufReader::new(stream.try_clone().unwrap());
        // As long as the client keeps the connection.
        while let Some((request, headers, body)) = read_request(&mut lines) {
            let mut words = request.split_whitespace();
            let (Some(method), Some(target)) = (words.next(), words.next()) else { return };
            let (path, query) = target.split_once('?').unwrap_or((target, ""));
            let key = decoded(path.trim_start_matches('/'));
            {
                let mut state = self.state.lock().unwrap();
                state.open += 1;
                state.most_open = state.most_open.max(state.open);
            }
            let answered = self.answer(&mut stream, (method, &key, query), &headers, body);
            self.state.lock().unwrap().open -= 1;
            if answered.is_none() {
                return;
            }
        }
    }

    /// `None` where the connection is to end.
    fn answer(
        &self,
        stream: &mut TcpStream,
        (method, key, query): (&str, &str, &str),
        headers: &HashMap<String, String>,
        body: Vec<u8>,
    ) -> Option<()> {
        let mut state = self.state.lock().unwrap();
        if !key.starts_with("web/") && !headers.contains_key("authorization") {
            state.unsigned += 1;
        }
        if query.contains("list-type=2") {
            let page = listing(&state.objects, key.trim_end_matches('/'), query);
            drop(state);
            return reply(
                stream,
                "200 OK",
                "Content-Type: application/xml\r\n",
                page.as_bytes(),
                method,
            );
        }
        let range = headers.get("range").cloned();
        state.asked.push(format!("{method} {key} {}", range.clone().unwrap_or_default()));
        let fault_of = match method {
            "GET" => key.to_owned(),
            _ => format!("{method} {key}"),
        };
        let fault = state.faults.get_mut(&fault_of).and_then(VecDeque::pop_front);
        match fault {
            Some(Fault::Silent) => {
                drop(state);
                std::thread::sleep(Duration::from_secs(600));
                return None;
            }
            Some(Fault::Late(time)) => {
                drop(state);
                std::thread::sleep(time);
                state = self.state.lock().unwrap();
            }
            _ => {}
        }
        if ["PUT", "POST", "DELETE"].contains(&method)
            && !matches!(fault, Some(Fault::Busy | Fault::Denied))
        {
            let (status, tags, text) = write(&mut state, (method, key, query), headers, body);
            drop(state);
            return reply(stream, status, &tags, text.as_bytes(), method);
        }
        if let Some(Fault::Replaced(bytes)) = &fault {
            state.objects.insert(key.into(), bytes.clone());
        }
        let object = state.objects.get(key).cloned();
        drop(state);
        let error = |code: &str| {
            let told: String = headers.values().map(String::as_str).collect();
            format!("<Error><Code>{code}</Code><StringToSign>{told}</StringToSign></Error>")
        };
        match fault {
            Some(Fault::Busy) => {
                return reply(stream, "503 Slow Down", "", error("SlowDown").as_bytes(), method);
            }
            Some(Fault::Denied) => {
                return reply(
                    stream,
                    "403 Forbidden",
                    "",
                    error("AccessDenied").as_bytes(),
                    method,
                );
            }
            _ => {}
        }
        let Some(object) = object else {
            return reply(stream, "404 Not Found", "", error("NoSuchKey").as_bytes(), method);
        };
        let etag = etag(&object);
        if headers.get("if-match").is_some_and(|wanted| *wanted != etag) {
            return reply(stream, "412 Precondition Failed", "", b"", method);
        }
        let tags = format!("ETag: {etag}\r\nLast-Modified: Fri, 27 Nov 2026 08:00:00 GMT\r\n");
        let Some((first, last)) = range.as_deref().and_then(bounds) else {
            return reply(stream, "200 OK", &tags, &object, method);
        };
        if first >= object.len() {
            return reply(stream, "416 Range Not Satisfiable", "", b"", method);
        }
        let part = &object[first..object.len().min(last + 1)];
        let end = first + part.len() - 1;
        let tags = format!("{tags}Content-Range: bytes {first}-{end}/{}\r\n", object.len());
        match fault {
            Some(Fault::Broken) => {
                let head = head("206 Partial Content", &tags, part.len());
                stream.write_all(head.as_bytes()).ok()?;
                stream.write_all(&part[..part.len() / 2]).ok()?;
                None
            }
            Some(Fault::Slow) => {
                let head = head("206 Partial Content", &tags, part.len());
                stream.write_all(head.as_bytes()).ok()?;
                for piece in part.chunks(part.len().div_ceil(8)) {
                    std::thread::sleep(Duration::from_millis(30));
                    stream.write_all(piece).ok()?;
                }
                Some(())
            }
            _ => reply(stream, "206 Partial Content", &tags, part, method),
        }
    }
}

/// Takes a whole object, or a part of one.
fn write(
    state: &mut State,
    (method, key, query): (&str, &str, &str),
    headers: &HashMap<String, String>,
    body: Vec<u8>,
) -> (&'static str, String, String) {
    let value = |name: &str| {
        let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
        pairs.filter(|(key, _)| *key == name).map(|(_, value)| decoded(value)).next()
    };
    let tag = |body: &[u8]| format!("ETag: {}\r\n", etag(body));
    let done = |tags| ("200 OK", tags, String::new());
    match (method, value("uploadId")) {
        ("POST", None) => {
            state.begun += 1;
            let id = format!("upload{}", state.begun);
            state.uploads.insert(id.clone(), BTreeMap::new());
            let text = format!(
                "<InitiateMultipartUploadResult><UploadId>{id}</UploadId>\
                 </InitiateMultipartUploadResult>"
            );
            ("200 OK", String::new(), text)
        }
        ("PUT", Some(id)) => {
            let number = value("partNumber").unwrap().parse().unwrap();
            let tags = tag(&body);
            state.uploads.get_mut(&id).unwrap().insert(number, body);
            done(tags)
        }
        ("POST", Some(id)) => {
            let whole: Vec<u8> =
                state.uploads.remove(&id).unwrap().into_values().flatten().collect();
            let text = format!(
                "<CompleteMultipartUploadResult><ETag>{}</ETag></CompleteMultipartUploadResult>",
                etag(&whole)
            );
            state.objects.insert(key.into(), whole);
            ("200 OK", String::new(), text)
        }
        ("DELETE", Some(id)) => {
            state.uploads.remove(&id);
            ("204 No Content", String::new(), String::new())
        }
        _ => {
            let only_new = headers.get("if-none-match").is_some_and(|tag| tag == "*");
            if only_new && state.objects.contains_key(key) {
                return ("412 Precondition Failed", String::new(), String::new());
            }
            let tags = tag(&body);
            state.objects.insert(key.into(), body);
            done(tags)
        }
    }
}

type Request = (String, HashMap<String, String>, Vec<u8>);

fn read_request(lines: &mut impl BufRead) -> Option<Request> {
    let line = |lines: &mut dyn BufRead| {
        let mut line = String::new();
        lines.take(1 << 16).read_line(&mut line).ok()?;
        Some(line.trim_end().to_owned())
    };
    let request = line(lines)?;
    let mut headers = HashMap::new();
    while let Some((name, value)) = line(lines)?.split_once(':') {
        headers.insert(name.to_ascii_lowercase(), value.trim().to_owned());
    }
    let length = headers.get("content-length").and_then(|length| length.parse().ok());
    let mut body = vec![0; length.unwrap_or(0)];
    lines.read_exact(&mut body).ok()?;
    (!request.is_empty()).then_some((request, headers, body))
}

fn head(status: &str, tags: &str, length: usize) -> String {
    format!("HTTP/1.1 {status}\r\n{tags}Content-Length: {length}\r\n\r\n")
}

fn reply(
    stream: &mut TcpStream,
    status: &str,
    tags: &str,
    body: &[u8],
    method: &str,
) -> Option<()> {
    stream.write_all(head(status, tags, body.len()).as_bytes()).ok()?;
    if method != "HEAD" {
        stream.write_all(body).ok()?;
    }
    Some(())
}

/// First and last byte of `bytes=0-99`.
fn bounds(range: &str) -> Option<(usize, usize)> {
    let (first, last) = range.strip_prefix("bytes=")?.split_once('-')?;
    Some((first.parse().ok()?, last.parse().ok()?))
}
