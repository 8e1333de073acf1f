//! Where the cache is: from the arguments, the environment, the user's file of settings and that of a lab.
//!
//! The first of these that says anything decides alone: `--cache`, `MESHMILL_CACHE`, the two files together. The files
//! have one form:
//!
//! ```toml
//! lab = "/lab/meshmill.toml"      # in the user's file only: the file of the lab
//! [cache]
//! local = "/scratch/me/meshmill"  # the first level; as a rule the user's cache folder
//! levels = [                      # the further ones, in the order in which they are asked
//!   { folder = "/lab/cache", read-only = true },
//!   { url = "s3://bucket/prefix", endpoint = "https://s3.lab", region = "lab-1" },
//! ]
//! ```
//!
//! The lab's levels come after the user's. What gives access to an object store is refused in a file: it would be
//! copied and shared with it.

use std::path::{Path, PathBuf};
use std::{env, fs, io};

use etcetera::BaseStrategy;
use toml::{Table, Value};

use super::exit::{Exit, Fault, say};
use crate::recipe::suggest::did_you_mean;
use crate::store::{LevelSpec, Location, RemoteSpec};

/// No file of settings is longer.
const LONGEST: u64 = 1 << 20;
/// Words in a key that name what must not stand in a file.
const SECRET: [&str; 6] = ["secret", "token", "password", "passphrase", "credential", "access-key"];

/// The levels of the cache, the nearest first.
pub(super) fn levels(arguments: &[PathBuf]) -> Result<Vec<LevelSpec>, Fault> {
    let given: Vec<LevelSpec> = arguments.iter().filter(|path| !path.as_os_str().is_empty()).map(level_of).collect();
    if !given.is_empty() {
        return first_is_a_folder(given, "--cache");
    }
    let listed: Vec<LevelSpec> =
        env::var_os("MESHMILL_CACHE").map(|list| split(&list)).unwrap_or_default().iter().map(level_of).collect();
    if !listed.is_empty() {
        return first_is_a_folder(listed, "MESHMILL_CACHE");
    }
    let user = user_file().map(|path| Settings::read(&path)).transpose()?.flatten().unwrap_or_default();
    let lab = lab_settings(&user)?;
    let local = user.local.or(lab.local).map_or_else(default_folder, Ok)?;
    let mut levels = vec![LevelSpec::folder(&local)];
    for level in user.levels.into_iter().chain(lab.levels) {
        if levels.iter().all(|known| known.at != level.at) {
            levels.push(level);
        }
    }
    Ok(levels)
}

fn level_of(path: impl AsRef<Path>) -> LevelSpec {
    let path = path.as_ref();
    // What is no text is no address either.
    path.to_str().map_or_else(|| LevelSpec::folder(path), LevelSpec::parse)
}

fn first_is_a_folder(levels: Vec<LevelSpec>, place: &str) -> Result<Vec<LevelSpec>, Fault> {
    for level in &levels {
        if let Location::Remote(remote) = &level.at {
            check_url(&remote.url, place)?;
        }
    }
    match levels.first().map(|level| &level.at) {
        Some(Location::Remote(remote)) => {
            let message = format!("{place}: the first level of the cache is a folder, not {}", remote.url);
            Err(Fault::usage(message).help("name a folder before it"))
        }
        _ => Ok(levels),
    }
}

/// The parts of a list as `PATH` is one; the colon of an address, before two slashes, parts nothing.
fn split(list: &std::ffi::OsStr) -> Vec<PathBuf> {
    let Some(text) = list.to_str().filter(|text| text.contains("://")) else {
        return env::split_paths(list).filter(|path| !path.as_os_str().is_empty()).collect();
    };
    let separator = if cfg!(windows) { ';' } else { ':' };
    let mut parts: Vec<String> = Vec::new();
    let mut glue = false;
    for part in text.split(separator) {
        if let Some(scheme) = parts.last_mut().filter(|_| glue && part.starts_with("//")) {
            scheme.push(separator);
            scheme.push_str(part);
            glue = false;
        } else {
            parts.push(part.to_owned());
            glue = !part.is_empty() && part.chars().all(|letter| letter.is_ascii_alphanumeric());
        }
    }
    parts.into_iter().filter(|part| !part.is_empty()).map(PathBuf::from).collect()
}

/// The cache of a user who has said nothing.
fn default_folder() -> Result<PathBuf, Fault> {
    match etcetera::choose_base_strategy() {
        Ok(strategy) => Ok(strategy.cache_dir().join("meshmill")),
        Err(error) => {
            let message = format!("there is no cache folder: {error}");
            Err(Fault::new(Exit::Store, message).help("name one with --cache DIR or MESHMILL_CACHE"))
        }
    }
}

/// The user's file of settings, whether it is there or not.
fn user_file() -> Option<PathBuf> {
    etcetera::choose_base_strategy().ok().map(|strategy| strategy.config_dir().join("meshmill").join("config.toml"))
}

/// What the file of the lab says: `MESHMILL_LAB`, else the one that the user's file names.
fn lab_settings(user: &Settings) -> Result<Settings, Fault> {
    let named = env::var_os("MESHMILL_LAB").filter(|file| !file.is_empty()).map(PathBuf::from);
    let Some(file) = named.or_else(|| user.lab.clone()) else { return Ok(Settings::default()) };
    if let Some(settings) = Settings::read(&file)? {
        return Ok(settings);
    }
    // Its disk may be away for a while; nobody should have to wait for it.
    say(&format!("warning: the file of the lab is not there: {}", file.display()));
    Ok(Settings::default())
}

/// What a file of settings says.
#[derive(Debug, Default)]
struct Settings {
    lab: Option<PathBuf>,
    local: Option<PathBuf>,
    levels: Vec<LevelSpec>,
}

impl Settings {
    /// Reads a file; `None` where there is none.
    fn read(path: &Path) -> Result<Option<Self>, Fault> {
        let fault = |why: &str| Fault::usage(format!("cannot read the settings {}: {why}", path.display()));
        let text = match fs::metadata(path) {
            Ok(meta) if meta.len() > LONGEST || !meta.is_file() => return Err(fault("it is no file of settings")),
            Ok(_) => fs::read_to_string(path).map_err(|error| fault(&error.to_string()))?,
            Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
                return Ok(None);
            }
            Err(error) => return Err(fault(&error.to_string())),
        };
        let table: Table = text.parse().map_err(|error: toml::de::Error| fault(&error.to_string()))?;
        Reader { path }.settings(&table).map(Some)
    }
}

/// Reads the tables of one file.
struct Reader<'a> {
    path: &'a Path,
}

impl Reader<'_> {
    fn fault(&self, what: &str) -> Fault {
        Fault::usage(format!("{}: {what}", self.path.display()))
    }

    /// Refuses secrets, and names keys that this version does not know: a newer one may.
    fn keys(&self, table: &Table, place: &str, known: &[&str]) -> Result<(), Fault> {
        for key in table.keys() {
            let plain = key.to_lowercase().replace('_', "-");
            if SECRET.iter().any(|word| plain.contains(word)) {
                let what = format!("`{key}`{place} is a secret, and a file of settings is no place for it");
                return Err(self.fault(&what).help(
                    "take it out and set the environment, such as AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY; whoever \
                     could read the file knows it now",
                ));
            }
            if !known.contains(&key.as_str()) {
                let file = self.path.display();
                let help = did_you_mean(key, "known are", known.iter().copied()).unwrap_or_default();
                say(&format!(
                    "warning: {file}: `{key}`{place} is not known to this version and counts for nothing; {help}"
                ));
            }
        }
        Ok(())
    }

    fn settings(&self, table: &Table) -> Result<Settings, Fault> {
        self.keys(table, "", &["lab", "cache"])?;
        let mut settings = Settings { lab: self.folder(table, "lab")?, ..Settings::default() };
        let cache = match table.get("cache") {
            None => return Ok(settings),
            Some(Value::Table(cache)) => cache,
            Some(_) => return Err(self.fault("`cache` is a table: [cache]")),
        };
        self.keys(cache, " of [cache]", &["local", "levels"])?;
        settings.local = self.folder(cache, "local")?;
        match cache.get("levels") {
            None => {}
            Some(Value::Array(levels)) => {
                settings.levels = levels.iter().map(|level| self.level(level)).collect::<Result<_, _>>()?;
            }
            Some(_) => return Err(self.fault("`levels` of [cache] is a list")),
        }
        Ok(settings)
    }

    fn level(&self, value: &Value) -> Result<LevelSpec, Fault> {
        let table = match value {
            Value::String(text) if text.contains("://") => {
                check_url(text, &self.path.display().to_string())?;
                return Ok(LevelSpec::parse(text));
            }
            Value::String(text) => return Ok(LevelSpec::folder(&self.place(text)?)),
            Value::Table(table) => table,
            _ => return Err(self.fault("a level of [cache] is a folder, an address, or a table with one of them")),
        };
        let known = ["folder", "url", "endpoint", "region", "allow-http", "read-only"];
        self.keys(table, " of a level", &known)?;
        let read_only = self.flag(table, "read-only")?;
        let at = match (self.folder(table, "folder")?, self.text(table, "url")?) {
            (Some(folder), None) => Location::Folder(folder),
            (None, Some(url)) => {
                check_url(&url, &self.path.display().to_string())?;
                let (endpoint, region) = (self.text(table, "endpoint")?, self.text(table, "region")?);
                let url = url.trim_end_matches('/').to_owned();
                Location::Remote(RemoteSpec { url, endpoint, region, allow_http: self.flag(table, "allow-http")? })
            }
            _ => return Err(self.fault("a level of [cache] has either a `folder` or a `url`")),
        };
        Ok(LevelSpec { at, read_only })
    }

    fn text(&self, table: &Table, key: &str) -> Result<Option<String>, Fault> {
        match table.get(key) {
            None => Ok(None),
            Some(Value::String(text)) if !text.is_empty() => Ok(Some(text.clone())),
            Some(_) => Err(self.fault(&format!("`{key}` is a text"))),
        }
    }

    fn flag(&self, table: &Table, key: &str) -> Result<bool, Fault> {
        match table.get(key) {
            None => Ok(false),
            Some(Value::Boolean(value)) => Ok(*value),
            Some(_) => Err(self.fault(&format!("`{key}` is true or false"))),
        }
    }

    fn folder(&self, table: &Table, key: &str) -> Result<Option<PathBuf>, Fault> {
        self.text(table, key)?.map(|text| self.place(&text)).transpose()
    }

    /// A path of the file: relative to the file, and `~` is the user's home.
    fn place(&self, text: &str) -> Result<PathBuf, Fault> {
        if let Some(rest) = text.strip_prefix("~/") {
            let home = etcetera::home_dir().map_err(|error| self.fault(&format!("`{text}`: {error}")))?;
            return Ok(home.join(rest));
        }
        Ok(self.path.parent().unwrap_or(Path::new(".")).join(text))
    }
}

/// Refuses an address with a secret in it, and one that names no kind of object store that there is.
fn check_url(url: &str, place: &str) -> Result<(), Fault> {
    let (scheme, rest) = url.split_once("://").unwrap_or(("", url));
    let host = rest.split('/').next().unwrap_or_default();
    if host.contains('@') || rest.contains('?') {
        return Err(Fault::usage(format!("{place}: an address of the cache holds no user, password or question mark"))
            .help("what gives access stands in the environment: AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY"));
    }
    if scheme != "s3" || host.is_empty() {
        return Err(Fault::usage(format!("{place}: `{url}` is no object store that is known"))
            .help("an address is s3://BUCKET/PREFIX, also with an endpoint of your own"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(text: &str) -> Result<Settings, Fault> {
        Reader { path: Path::new("/lab/meshmill.toml") }.settings(&text.parse::<Table>().unwrap())
    }

    #[test]
    fn a_list_is_parted_as_a_path_is_and_addresses_stay_whole() {
        let parts = |text: &str| -> Vec<String> {
            split(text.as_ref()).iter().map(|part| part.to_str().unwrap().to_owned()).collect()
        };
        if cfg!(unix) {
            assert_eq!(parts("/a:/b/c"), ["/a", "/b/c"]);
            assert_eq!(parts("/a:s3://bucket/x:/b"), ["/a", "s3://bucket/x", "/b"]);
            assert_eq!(parts("/a:://b:"), ["/a", "//b"]);
        }
        assert_eq!(parts("a"), ["a"]);
        assert!(parts("").is_empty());
    }

    #[test]
    fn levels_are_folders_beside_the_file_or_addresses() {
        let read = settings(
            "[cache]\nlocal = \"mine\"\nlevels = [\"/lab/cache\", { folder = \"near\", read-only = true }, \
             { url = \"s3://b/p/\", region = \"r\", endpoint = \"http://e\", allow-http = true }]",
        )
        .unwrap();
        assert_eq!(read.local, Some(PathBuf::from("/lab/mine")));
        let remote = RemoteSpec {
            url: "s3://b/p".into(),
            endpoint: Some("http://e".into()),
            region: Some("r".into()),
            allow_http: true,
        };
        let expected = [
            LevelSpec::folder(Path::new("/lab/cache")),
            LevelSpec { at: Location::Folder("/lab/near".into()), read_only: true },
            LevelSpec { at: Location::Remote(remote), read_only: false },
        ];
        assert_eq!(read.levels, expected);
    }

    #[test]
    fn what_is_wrong_or_secret_is_refused() {
        for text in [
            "cache = 1",
            "lab = 2",
            "[cache]\nlevels = \"a\"",
            "[cache]\nlevels = [1]",
            "[cache]\nlevels = [{}]",
            "[cache]\nlevels = [{ folder = \"a\", url = \"s3://b\" }]",
            "[cache]\nlevels = [{ folder = \"a\", read-only = 1 }]",
            "[cache]\nlevels = [\"ftp://b\"]",
            "[cache]\nlevels = [\"s3://\"]",
            "[cache]\nlevels = [\"s3://key:word@bucket\"]",
            "[cache]\nlevels = [{ url = \"s3://b\", secret_access_key = \"x\" }]",
            "[cache]\naws-session-token = \"x\"",
            "AWS_ACCESS_KEY_ID = \"x\"",
        ] {
            assert_eq!(settings(text).unwrap_err().exit, Exit::Usage, "{text}");
        }
        assert!(settings("").unwrap().levels.is_empty());
    }
}
