//! A level in an object store that speaks the protocol of Amazon S3.
//!
//! The objects have the names of the files of a folder, below the prefix of the address, so that one can be copied to
//! the other by any tool. The crate that speaks the protocol is asynchronous; what it does is awaited here, one request
//! at a time and thread, and nothing asynchronous is seen outside of this module.
//!
//! # Invariants
//! - What gives access comes from the environment alone, and is asked of no other server.
//! - An object is written by one request, so that it is there whole or not at all; what is read is verified by whoever
//!   asked, as on every level.
//! - Any trouble but a missing object is trouble of the whole level: after two more tries, and a pause of at most
//!   half a minute in which nothing comes, it is given up.
//!
//! # Departures
//! A hit does not move the time of an object, so that garbage is collected by the time of writing.

use std::any::Any;
use std::env;
use std::path::PathBuf;
use std::time::Duration;

use blake3::Hash;
use futures_util::TryStreamExt;
use object_store::aws::{AmazonS3, AmazonS3Builder};
use object_store::path::Path;
use object_store::{ClientOptions, Error, ObjectStore, ObjectStoreExt, RetryConfig};
use tokio::runtime::{Builder, Runtime};

use super::StoreError;
use super::folder::LAYOUT;
use super::place::{Item, Kind, Place, RemoteSpec, Trouble};

/// Longest wait for a connection.
const CONNECT: Duration = Duration::from_secs(5);
/// Longest pause within an answer.
const PAUSE: Duration = Duration::from_secs(30);
/// Longest request: a large mesh over a slow line.
const REQUEST: Duration = Duration::from_mins(15);
/// Tries after the first one, and for how long they are begun.
const RETRIES: (usize, Duration) = (2, Duration::from_secs(20));
/// Where nothing names a region.
const REGION: &str = "us-east-1";
/// The variables of which one says who asks.
const ACCESS: [&str; 4] = [
    "AWS_ACCESS_KEY_ID",
    "AWS_WEB_IDENTITY_TOKEN_FILE",
    "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
    "AWS_CONTAINER_CREDENTIALS_FULL_URI",
];

/// A level in a bucket.
#[derive(Debug)]
pub(super) struct Bucket {
    url: String,
    prefix: Path,
    store: AmazonS3,
    runtime: Runtime,
}

impl Bucket {
    /// A level at this address. Nothing is asked of the server yet.
    pub(super) fn open(spec: &RemoteSpec) -> Result<Self, StoreError> {
        let failed = |reason: String| StoreError::Level { level: spec.url.clone(), reason };
        let is_set = |name: &&str| env::var_os(name).is_some_and(|value| !value.is_empty());
        if !ACCESS.iter().any(is_set) {
            let reason = "the environment gives no access: AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY are not set";
            return Err(failed(reason.to_owned()));
        }
        let place = spec.url.strip_prefix("s3://").ok_or_else(|| failed("its address is not of S3".to_owned()))?;
        let (bucket, prefix) = place.split_once('/').unwrap_or((place, ""));
        let allow_http = spec.allow_http || env::var("AWS_ALLOW_HTTP").is_ok_and(|value| value == "true");
        let client = ClientOptions::new().with_connect_timeout(CONNECT).with_read_timeout(PAUSE).with_timeout(REQUEST);
        let (max_retries, retry_timeout) = RETRIES;
        let retry = RetryConfig { max_retries, retry_timeout, ..RetryConfig::default() };
        let mut builder = AmazonS3Builder::from_env().with_bucket_name(bucket).with_retry(retry);
        builder = builder.with_client_options(client.with_allow_http(allow_http));
        let in_env = ["AWS_REGION", "AWS_DEFAULT_REGION"].iter().any(is_set);
        if let Some(region) = spec.region.as_deref().or((!in_env).then_some(REGION)) {
            builder = builder.with_region(region);
        }
        if let Some(endpoint) = &spec.endpoint {
            builder = builder.with_endpoint(endpoint);
        }
        let store = builder.build().map_err(|error| failed(error.to_string()))?;
        let prefix = Path::parse(prefix).map_err(|error| failed(error.to_string()))?;
        let runtime = Builder::new_current_thread().enable_all().build().map_err(|error| failed(error.to_string()))?;
        Ok(Self { url: spec.url.clone(), prefix, store, runtime })
    }

    fn folder(&self, kind: Kind) -> Path {
        self.prefix.clone().join(LAYOUT).join(kind.folder())
    }

    fn path(&self, kind: Kind, hash: &Hash) -> Path {
        let hex = hash.to_hex();
        self.folder(kind).join(&hex[..2]).join(hex.as_str())
    }

    fn failed(&self, error: &Error) -> StoreError {
        StoreError::Level { level: self.url.clone(), reason: error.to_string() }
    }
}

impl Place for Bucket {
    fn read(&self, kind: Kind, hash: &Hash) -> Result<Option<Vec<u8>>, Trouble> {
        let path = self.path(kind, hash);
        match self.runtime.block_on(async { self.store.get(&path).await?.bytes().await }) {
            Ok(bytes) => Ok(Some(bytes.into())),
            Err(Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(Trouble::Level(self.failed(&error))),
        }
    }

    fn has(&self, kind: Kind, hash: &Hash, length: usize) -> bool {
        let head = self.runtime.block_on(self.store.head(&self.path(kind, hash)));
        head.is_ok_and(|head| head.size == length as u64)
    }

    fn write(&self, kind: Kind, hash: &Hash, bytes: &[u8]) -> Result<(), StoreError> {
        let written = self.runtime.block_on(self.store.put(&self.path(kind, hash), bytes.to_vec().into()));
        written.map(drop).map_err(|error| self.failed(&error))
    }

    fn remove(&self, kind: Kind, hash: &Hash) -> Result<(), StoreError> {
        match self.runtime.block_on(self.store.delete(&self.path(kind, hash))) {
            Ok(()) | Err(Error::NotFound { .. }) => Ok(()),
            Err(error) => Err(self.failed(&error)),
        }
    }

    fn list(&self, kind: Kind) -> Result<Vec<Item>, StoreError> {
        let folder = self.folder(kind);
        let listed = self.runtime.block_on(self.store.list(Some(&folder)).try_collect::<Vec<_>>());
        let objects = listed.map_err(|error| self.failed(&error))?;
        let item = |object: object_store::ObjectMeta| {
            let hash = Hash::from_hex(object.location.filename()?).ok()?;
            let (path, bytes) = (self.name(kind, &hash), object.size);
            Some(Item { hash, path, bytes, modified: object.last_modified.into() })
        };
        let mut items: Vec<Item> = objects.into_iter().filter_map(item).collect();
        items.sort_by(|a, b| a.hash.as_bytes().cmp(b.hash.as_bytes()));
        Ok(items)
    }

    fn refresh(&self, _kind: Kind, _hash: &Hash, _bytes: &[u8]) {}

    fn name(&self, kind: Kind, hash: &Hash) -> PathBuf {
        let hex = hash.to_hex();
        format!("{}/{LAYOUT}/{}/{}/{hex}", self.url, kind.folder(), &hex[..2]).into()
    }

    fn as_any(&self) -> &dyn Any {
        self
    }
}
