//! Object stores as levels of the cache, against moto, which is started here: back-fill, a lost connection, wrong
//! credentials, damaged objects. Skipped, and said so, where Python or moto is not there: `pip install 'moto[server]'`.

#![cfg(feature = "remote")]

use std::fs;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::Duration;

use predicates::prelude::*;

#[path = "common/desk.rs"]
mod desk;

use desk::Desk;

const RECIPE: &str = r#"
name = "part"
[inputs]
part = "cube.obj"
[steps.raw]
use = "read"
file = "=inputs.part"
[steps.clean]
use = "repair"
from = "raw"
[steps.fine]
use = "subdivide"
from = "clean"
times = 3
[outputs]
fine = ["result.stl"]
"#;

const CUBE: &str = include_str!("common/cube.obj");
const BUCKET: &str = "meshes";
const SECRET: &str = "the-secret-of-this-test";

/// Asks moto by its own means; `{0}` is the address.
const CLIENT: &str = r#"
import sys, boto3, requests
address, verb = sys.argv[1:3]
s3 = boto3.client("s3", endpoint_url=address, aws_access_key_id="a", aws_secret_access_key="b", region_name="us-east-1")
objects = lambda: [o["Key"] for o in s3.list_objects_v2(Bucket="meshes").get("Contents", [])]
if verb == "make":
    s3.create_bucket(Bucket="meshes")
elif verb == "list":
    print("\n".join(objects()))
elif verb == "truncate":
    for key in objects():
        body = s3.get_object(Bucket="meshes", Key=key)["Body"].read()
        s3.put_object(Bucket="meshes", Key=key, Body=body[: len(body) // 2])
elif verb == "guard":
    requests.post(address + "/moto-api/reset-auth", data=b"0").raise_for_status()
"#;

/// A server that ends with the value.
struct Server {
    process: Child,
    address: String,
    python: String,
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Server {
    /// Starts one with an empty bucket; `None`, and said so, where it cannot be started.
    fn start() -> Option<Self> {
        let python = std::env::var("PYTHON").unwrap_or_else(|_| "python3".to_owned());
        let known =
            Command::new(&python).args(["-c", "import moto.server, boto3, requests"]).stderr(Stdio::null()).status();
        if !known.is_ok_and(|status| status.success()) {
            // Past the output that the tests keep to themselves.
            let _ = writeln!(std::io::stderr(), "SKIPPED object stores: this needs moto (pip install 'moto[server]')");
            return None;
        }
        let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let start = format!("from moto.server import main; main(['-H', '127.0.0.1', '-p', '{port}'])");
        let mut command = Command::new(&python);
        let process = command.args(["-c", &start]).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let server = Self { process, address: format!("http://127.0.0.1:{port}"), python };
        let up = (0..600).any(|_| {
            std::thread::sleep(Duration::from_millis(100));
            TcpStream::connect(("127.0.0.1", port)).is_ok()
        });
        assert!(up, "moto does not answer");
        server.ask("make");
        Some(server)
    }

    fn ask(&self, verb: &str) -> String {
        let output = Command::new(&self.python).args(["-c", CLIENT, &self.address, verb]).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }
}

/// A desk whose settings name a bucket behind this address as the second level.
fn desk(address: &str) -> Desk {
    let desk = Desk::with(&[("recipe.toml", RECIPE), ("cube.obj", CUBE)]);
    settings(&desk, address);
    desk
}

fn settings(desk: &Desk, address: &str) {
    let level = format!("{{ url = \"s3://{BUCKET}/lab\", endpoint = \"{address}\", allow-http = true }}");
    desk.write("config/meshmill/config.toml", &format!("[cache]\nlevels = [{level}]\n"));
}

/// The command with a first level of this name.
fn meshmill(desk: &Desk, first: &str, arguments: &[&str]) -> assert_cmd::Command {
    let mut command = desk.meshmill(arguments);
    command.env_remove("MESHMILL_CACHE").env("XDG_CONFIG_HOME", desk.path("config"));
    command.env("XDG_CACHE_HOME", desk.path(first)).env("AWS_ACCESS_KEY_ID", "a").env("AWS_SECRET_ACCESS_KEY", SECRET);
    command.env_remove("AWS_SESSION_TOKEN").env("NO_PROXY", "127.0.0.1").env("no_proxy", "127.0.0.1");
    command
}

fn run(desk: &Desk, first: &str) -> assert_cmd::Command {
    meshmill(desk, first, &["run", "recipe.toml", "--json", "--pictures", "none", "--out", &format!("out-{first}")])
}

/// How many tasks a run computed.
fn ran(output: &std::process::Output) -> u64 {
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    report["timings"]["ran"].as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum()
}

fn result(desk: &Desk, first: &str) -> Vec<u8> {
    fs::read(desk.path(&format!("out-{first}/result.stl"))).unwrap()
}

const LOST: &str = "the cache goes on without its level s3://meshes/lab";

#[test]
fn a_bucket_fills_the_first_level_and_is_looked_after() {
    let Some(server) = Server::start() else { return };
    let desk = desk(&server.address);
    let first = run(&desk, "one").assert().success().stderr(predicate::str::contains("WARN").not());
    assert_eq!(ran(first.get_output()), 3);
    assert!(!desk.text("out-one/run.ron").contains(SECRET));
    let listed = server.ask("list");
    assert!(listed.lines().all(|key| key.starts_with("lab/v2/ac/") || key.starts_with("lab/v2/cas/")), "{listed}");
    let second = run(&desk, "two").assert().success();
    assert_eq!((ran(second.get_output()), result(&desk, "two")), (0, result(&desk, "one")));
    // Filled by that, the first level serves alone.
    settings(&desk, "http://127.0.0.1:9");
    fs::remove_dir_all(desk.path("out-two")).unwrap();
    let third = run(&desk, "two").assert().success().stderr(predicate::str::contains(LOST).not());
    assert_eq!((ran(third.get_output()), result(&desk, "two")), (0, result(&desk, "one")));
    settings(&desk, &server.address);
    let cache = |arguments: &[&str]| meshmill(&desk, "two", &[&["cache"], arguments].concat()).assert();
    cache(&["stat"]).success().stdout(predicate::str::contains("address    s3://meshes/lab"));
    cache(&["verify", "--level", "2"]).success();
    server.ask("truncate");
    cache(&["verify", "--level", "2"])
        .code(6)
        .stderr(predicate::str::contains("damaged, removed: s3://meshes/lab/v2/"));
    assert_eq!(server.ask("list").trim(), "");
    cache(&["push"]).success().stdout(predicate::str::contains("to s3://meshes/lab: "));
    cache(&["clear"]).success();
    // The first level had been filled with the one mesh that an output needed, so that no other could be pushed.
    cache(&["pull", "--level", "s3://meshes/lab"]).success().stdout(predicate::str::contains("1 artifacts"));
    cache(&["gc", "--level", "2", "--max-size", "0"]).success();
    assert_eq!(server.ask("list").trim(), "");
}

#[test]
fn objects_that_are_cut_short_are_made_good() {
    let Some(server) = Server::start() else { return };
    let desk = desk(&server.address);
    run(&desk, "one").assert().success();
    server.ask("truncate");
    let second = run(&desk, "two").assert().success().stderr(predicate::str::contains("damaged"));
    assert_eq!((ran(second.get_output()), result(&desk, "two")), (3, result(&desk, "one")));
    let third = run(&desk, "three").assert().success().stderr(predicate::str::contains("damaged").not());
    assert_eq!((ran(third.get_output()), result(&desk, "three")), (0, result(&desk, "one")));
}

#[test]
fn wrong_credentials_and_none_are_said_once() {
    let Some(server) = Server::start() else { return };
    let desk = desk(&server.address);
    run(&desk, "one").assert().success();
    let none = run(&desk, "two").env_remove("AWS_ACCESS_KEY_ID").assert().success();
    none.stderr(predicate::str::contains(LOST).count(1).and(predicate::str::contains("AWS_ACCESS_KEY_ID")));
    server.ask("guard");
    let wrong = run(&desk, "three").assert().success().stderr(predicate::str::contains(LOST).count(1));
    assert_eq!((ran(wrong.get_output()), result(&desk, "three")), (3, result(&desk, "one")));
}

/// Passes requests on, and ends every answer about a blob in its middle. Returns its address.
fn cutter(server: &str) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}", listener.local_addr().unwrap());
    let server = server.trim_start_matches("http://").to_owned();
    std::thread::spawn(move || {
        for client in listener.incoming().map_while(Result::ok) {
            let server = server.clone();
            std::thread::spawn(move || pass_on(client, &server));
        }
    });
    address
}

/// One request, without a body, of one connection.
fn pass_on(mut client: TcpStream, server: &str) -> std::io::Result<()> {
    let (mut request, mut byte) = (Vec::new(), [0]);
    while !request.ends_with(b"\r\n\r\n") && client.read(&mut byte)? > 0 {
        request.push(byte[0]);
    }
    let text = String::from_utf8_lossy(&request).replace("\r\n\r\n", "\r\nconnection: close\r\n\r\n");
    let is_blob = text.starts_with("GET") && text.contains("/cas/");
    let mut upstream = TcpStream::connect(server)?;
    upstream.write_all(text.as_bytes())?;
    let mut answer = Vec::new();
    if is_blob {
        upstream.read_to_end(&mut answer)?;
        let head = answer.windows(4).position(|end| end == b"\r\n\r\n").map_or(0, |at| at + 4);
        return client.write_all(&answer[..head + (answer.len() - head) / 2]);
    }
    // What else is asked may have a body, which comes as long as it comes.
    let (mut body, mut sink) = (client.try_clone()?, upstream.try_clone()?);
    std::thread::spawn(move || std::io::copy(&mut body, &mut sink));
    std::io::copy(&mut upstream, &mut client)?;
    client.shutdown(std::net::Shutdown::Both)
}

#[test]
fn a_connection_that_is_lost_in_the_middle_costs_time_and_nothing_else() {
    let Some(server) = Server::start() else { return };
    let desk = desk(&server.address);
    run(&desk, "one").assert().success();
    settings(&desk, &cutter(&server.address));
    let cut = run(&desk, "two").assert().success().stderr(predicate::str::contains(LOST).count(1));
    assert!(ran(cut.get_output()) > 0);
    assert_eq!(result(&desk, "two"), result(&desk, "one"));
    settings(&desk, &server.address);
    meshmill(&desk, "two", &["cache", "verify", "--level", "all"]).assert().success();
    // A server that is away altogether.
    settings(&desk, "http://127.0.0.1:9");
    let away = run(&desk, "three").assert().success().stderr(predicate::str::contains(LOST).count(1));
    assert_eq!((ran(away.get_output()), result(&desk, "three")), (3, result(&desk, "one")));
}
