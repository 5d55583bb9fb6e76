//! How the store on the loopback lists objects.

use std::collections::BTreeMap;

/// Names that a page of a listing has.
const PAGE: usize = 3;

pub fn etag(object: &[u8]) -> String {
    let mixed =
        object.iter().fold(0_u64, |sum, byte| sum.wrapping_mul(31).wrapping_add(u64::from(*byte)));
    format!("\"{mixed:016x}\"")
}

pub fn listing(objects: &BTreeMap<String, Vec<u8>>, bucket: &str, query: &str) -> String {
    let value = |name: &str| {
        let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
        pairs.filter(|(key, _)| *key == name).map(|(_, value)| decoded(value)).next()
    };
    let prefix = format!("{bucket}/{}", value("prefix").unwrap_or_default());
    let after = value("continuation-token").unwrap_or_default();
    let mut found = objects.iter().filter(|(key, _)| key.starts_with(&prefix) && **key > after);
    let page: Vec<_> = found.by_ref().take(PAGE).collect();
    let mut xml = String::from("<?xml version=\"1.0\"?><ListBucketResult>");
    for (key, bytes) in &page {
        let key = key[bucket.len() + 1..].replace('&', "&amp;").replace('<', "&lt;");
        xml.push_str(&format!(
            "<Contents><Key>{key}</Key><Size>{}</Size><ETag>{}</ETag>\
             <LastModified>2026-11-27T08:00:00.000Z</LastModified></Contents>",
            bytes.len(),
            etag(bytes).replace('"', "&quot;"),
        ));
    }
    if let (Some(_), Some((last, _))) = (found.next(), page.last()) {
        xml.push_str(&format!("<NextContinuationToken>{last}</NextContinuationToken>"));
    }
    xml + "</ListBucketResult>"
}

pub fn decoded(text: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = text.bytes();
    while let Some(byte) = rest.next() {
        let hex: Option<Vec<u8>> = (byte == b'%').then(|| rest.by_ref().take(2).collect());
        let value = hex.and_then(|hex| u8::from_str_radix(&String::from_utf8(hex).ok()?, 16).ok());
        bytes.push(value.unwrap_or(byte));
    }
    String::from_utf8(bytes).unwrap()
}
