//! A cache of many: levels on folders that others share, with their rights, their limits, and what goes wrong there.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

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
times = 2
[outputs]
fine = ["result.stl"]
"#;

const CUBE: &str = include_str!("common/cube.obj");

fn desk() -> Desk {
    let desk = Desk::with(&[("recipe.toml", RECIPE), ("cube.obj", CUBE)]);
    fs::create_dir(desk.path("lab")).unwrap();
    desk
}

/// A run into the folder `out` with these levels.
fn run(desk: &Desk, out: &str, levels: &[&str]) -> assert_cmd::Command {
    let mut command = desk.meshmill(&["run", "recipe.toml", "--pictures", "none", "--out", out]);
    command.args(levels.iter().flat_map(|level| ["--cache", level]));
    command
}

/// How many tasks ran, as a report in JSON tells.
fn ran(report: &[u8]) -> u64 {
    ran_of(&serde_json::from_slice(report).unwrap())
}

fn ran_of(report: &serde_json::Value) -> u64 {
    report["timings"]["ran"].as_object().unwrap().values().map(|count| count.as_u64().unwrap()).sum()
}

/// How many results a level has.
fn results(desk: &Desk, level: &str) -> u64 {
    let stat = desk.meshmill(&["cache", "stat", "--json", "--cache", level]).output().unwrap().stdout;
    let stat: serde_json::Value = serde_json::from_slice(&stat).unwrap();
    stat["levels"][0]["contents"]["entries"].as_u64().unwrap()
}

/// The files of a level's artifacts.
fn artifacts(desk: &Desk, level: &str) -> Vec<PathBuf> {
    let entries = |folder: PathBuf| fs::read_dir(folder).into_iter().flatten().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries(desk.path(&format!("{level}/v2/cas"))).flat_map(entries).collect();
    files.sort();
    files
}

#[test]
fn what_one_has_made_another_finds() {
    let desk = desk();
    run(&desk, "one", &["first", "lab"]).assert().success();
    let made = results(&desk, "lab");
    assert_eq!((made, results(&desk, "first")), (made, made));
    let second = run(&desk, "two", &["second", "lab"]).arg("--json").assert().success();
    assert_eq!(ran(&second.get_output().stdout), 0);
    assert_eq!(fs::read(desk.path("one/result.stl")).unwrap(), fs::read(desk.path("two/result.stl")).unwrap());
    assert!(results(&desk, "second") >= 3, "the first level was not filled");
    // Back-filled, it serves without the lab.
    fs::rename(desk.path("lab"), desk.path("away")).unwrap();
    let third = run(&desk, "three", &["second"]).arg("--json").assert().success();
    assert_eq!(ran(&third.get_output().stdout), 0);
}

#[test]
fn a_damaged_level_gives_no_wrong_mesh() {
    let desk = desk();
    run(&desk, "one", &["first", "lab"]).assert().success();
    let mut files = Vec::new();
    let mut folders = vec![desk.path("lab/v2")];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            if entry.is_dir() { folders.push(entry) } else { files.push(entry) }
        }
    }
    files.sort();
    for (number, file) in files.iter().enumerate() {
        let bytes = fs::read(file).unwrap();
        fs::write(file, &bytes[..bytes.len() * (number % 3) / 3]).unwrap();
    }
    let other = run(&desk, "two", &["second", "lab"]).assert().success();
    other.stderr(predicate::str::contains("damaged"));
    assert_eq!(fs::read(desk.path("one/result.stl")).unwrap(), fs::read(desk.path("two/result.stl")).unwrap());
    for level in ["second", "lab"] {
        desk.meshmill(&["cache", "verify", "--cache", level]).assert().success();
    }
}

#[test]
fn a_level_that_is_not_there_is_said_once_and_six_is_for_none_at_all() {
    let desk = desk();
    let once = predicate::str::contains("goes on without its level nowhere").count(1);
    run(&desk, "one", &["first", "nowhere"]).assert().success().stderr(once);
    assert!(!desk.path("nowhere").exists(), "a mount point was written to");
    run(&desk, "one", &["recipe.toml", "lab"]).assert().success().stderr(predicate::str::contains("recipe.toml"));
    run(&desk, "two", &["recipe.toml", "nowhere"]).assert().code(6);
    run(&desk, "two", &["s3://bucket/x", "lab"]).assert().code(2).stderr(predicate::str::contains("folder"));
}

#[test]
fn settings_name_the_levels_and_the_arguments_come_first() {
    let desk = desk();
    let lab = "[cache]\nlevels = [{ folder = \"lab\" }]\n";
    desk.write("lab.toml", lab);
    let config = format!("lab = {:?}\n[cache]\nlocal = \"../../mine\"\nto-come = 1\n", desk.path("lab.toml"));
    desk.write("config/meshmill/config.toml", &config);
    let meshmill = |arguments: &[&str]| {
        let mut command = desk.meshmill(arguments);
        command.env_remove("MESHMILL_CACHE").env("XDG_CONFIG_HOME", desk.path("config"));
        command.env("XDG_CACHE_HOME", desk.path("xdg"));
        command
    };
    let first = meshmill(&["run", "recipe.toml", "-q"]).assert().success();
    first.stderr(predicate::str::contains("`to-come` of [cache] is not known"));
    let made = results(&desk, "mine");
    assert_eq!(results(&desk, "lab"), made);
    let listed = meshmill(&["cache", "stat", "--makers"]).assert().success();
    listed.stdout(
        predicate::str::contains("mine")
            .and(predicate::str::contains("lab"))
            .and(predicate::str::contains(format!("made by    {} on ", env!("CARGO_PKG_VERSION")))),
    );
    // The environment, then the arguments, speak instead of the files.
    let env = desk.path("a").display().to_string() + ":" + &desk.path("lab").display().to_string();
    meshmill(&["cache", "stat"]).env("MESHMILL_CACHE", &env).assert().code(2);
    meshmill(&["run", "recipe.toml", "-q", "--out", "b"]).env("MESHMILL_CACHE", &env).assert().success();
    assert!(desk.path("a/v2").is_dir());
    meshmill(&["run", "recipe.toml", "-q", "--out", "c", "--cache", "c-cache"])
        .env("MESHMILL_CACHE", &env)
        .assert()
        .success();
    assert!(desk.path("c-cache/v2").is_dir());
    // The lab's file alone, the folder of the user as ever.
    fs::remove_file(desk.path("config/meshmill/config.toml")).unwrap();
    meshmill(&["run", "recipe.toml", "-q", "--out", "d"]).env("MESHMILL_LAB", desk.path("lab.toml")).assert().success();
    assert!(desk.path("xdg/meshmill/v2").is_dir());
    let gone = meshmill(&["run", "recipe.toml"]).env("MESHMILL_LAB", desk.path("gone.toml")).assert().success();
    gone.stderr(predicate::str::contains("the file of the lab is not there"));
    for (text, said) in [
        ("[cache]\nlevels = [{ url = \"s3://b\", access-key-id = \"AKIA\" }]", "AWS_ACCESS_KEY_ID"),
        ("[cache]\nlevels = [\"s3://key:word@b\"]", "environment"),
        ("[cache", "config.toml"),
    ] {
        desk.write("config/meshmill/config.toml", text);
        meshmill(&["run", "recipe.toml"]).assert().code(2).stderr(predicate::str::contains(said));
    }
}

#[test]
fn levels_are_looked_after_one_by_one() {
    let desk = desk();
    run(&desk, "one", &["first", "lab"]).assert().success();
    let made = results(&desk, "lab");
    let cache = |arguments: &[&str]| {
        let mut command = desk.meshmill(&["cache"]);
        command.args(arguments).args(["--cache", "first", "--cache", "lab"]);
        command
    };
    cache(&["gc", "--max-size", "0"]).assert().success();
    assert_eq!((results(&desk, "first"), results(&desk, "lab")), (0, made), "gc took more than the first level");
    cache(&["pull"]).assert().success().stdout(predicate::str::contains(format!("{made} results")));
    // A level that was filled on the way has results whose meshes nobody has asked for: those come too.
    let meshes = artifacts(&desk, "first");
    assert!(!meshes.is_empty());
    for mesh in &meshes {
        fs::remove_file(mesh).unwrap();
    }
    cache(&["pull"]).assert().success();
    assert_eq!(artifacts(&desk, "first"), meshes);
    cache(&["clear", "--level", "2"]).assert().success();
    cache(&["push", "--level", "lab"]).assert().success().stdout(predicate::str::contains(format!("{made} results")));
    assert_eq!((results(&desk, "first"), results(&desk, "lab")), (made, made));
    cache(&["verify", "--level", "all"]).assert().success();
    cache(&["verify", "--level", "3"]).assert().code(2);
    desk.meshmill(&["cache", "push", "--cache", "first"]).assert().code(2);
}

#[test]
fn a_locked_run_is_pinned() {
    let desk = desk();
    desk.meshmill(&["lock", "recipe.toml"]).assert().success();
    assert!(desk.text("part.lock.ron").contains("fine"));
    desk.meshmill(&["cache", "pins"]).assert().success().stdout(predicate::str::contains("part.lock.ron"));
    let gc = || desk.meshmill(&["cache", "gc", "--max-size", "0"]).assert().success();
    gc().stdout(predicate::str::contains("a lock pins them"));
    let locked = desk.meshmill(&["run", "recipe.toml", "--locked", "--json"]).assert().success();
    assert_eq!(ran(&locked.get_output().stdout), 0);
    desk.meshmill(&["cache", "unpin", "part.lock.ron"]).assert().success();
    gc();
    assert_eq!(results(&desk, "cache"), 0);
    desk.meshmill(&["cache", "unpin", "part.lock.ron"]).assert().code(2);
    desk.meshmill(&["run", "recipe.toml", "--locked"]).assert().success();
    desk.meshmill(&["cache", "pins"]).assert().success().stdout(predicate::str::contains("part.lock.ron"));
}

/// Says what is not tested, past the output that the tests keep to themselves.
#[cfg(target_os = "linux")]
fn skipped(what: &str) {
    use std::io::Write;
    let _ = writeln!(std::io::stderr(), "SKIPPED {what}");
}

/// Runs a script in which disks can be mounted that nobody else sees; `None`, and said so, where that is not allowed.
#[cfg(target_os = "linux")]
fn with_mounts(desk: &Desk, what: &str, script: &str) -> Option<Output> {
    let able = |arguments: &[&str]| {
        let mut command = Command::new("unshare");
        let mounted = command.args(arguments).args(["sh", "-c", "mount -t tmpfs none /mnt"]).output();
        mounted.is_ok_and(|output| output.status.success())
    };
    let Some(arguments) = [&["-m"][..], &["-r", "-m"][..]].into_iter().find(|arguments| able(arguments)) else {
        skipped(&format!("{what}: disks cannot be mounted here"));
        return None;
    };
    let mut command = Command::new("unshare");
    command.current_dir(desk.path("")).env_remove("MESHMILL_CACHE").env("MESHMILL", program(desk)).args(arguments);
    Some(command.args(["sh", "-c", script]).output().unwrap())
}

/// The program where every user can run it.
#[cfg(target_os = "linux")]
fn program(desk: &Desk) -> std::path::PathBuf {
    use std::os::unix::fs::PermissionsExt;
    let program = desk.path("meshmill");
    let built = assert_cmd::cargo::cargo_bin!("meshmill");
    fs::copy(built, &program).unwrap();
    fs::set_permissions(desk.path(""), fs::Permissions::from_mode(0o755)).unwrap();
    program
}

#[cfg(target_os = "linux")]
fn text(output: &Output) -> String {
    String::from_utf8_lossy(&[output.stdout.as_slice(), &output.stderr].concat()).into_owned()
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_folder_and_one_that_is_read_only_are_passed_over() {
    let desk = desk();
    run(&desk, "expected", &["first"]).assert().success();
    let expected = fs::read(desk.path("expected/result.stl")).unwrap();
    let same = |out: &str| assert_eq!(fs::read(desk.path(out).join("result.stl")).unwrap(), expected);
    let full = "set -e; mount -t tmpfs -o size=16k none lab
        $MESHMILL run recipe.toml --pictures none --out full --cache second --cache lab
        $MESHMILL cache verify --cache lab
        $MESHMILL run recipe.toml --pictures none --out alone --cache lab
        $MESHMILL cache verify --cache lab";
    let Some(output) = with_mounts(&desk, "a full folder", full) else { return };
    let said = text(&output);
    assert!(output.status.success(), "{said}");
    assert_eq!(said.matches("nothing more is written to the level lab").count(), 1, "{said}");
    assert!(said.contains("the cache could not be written"), "{said}");
    same("full");
    same("alone");
    let read_only = "set -e; mount -t tmpfs none lab
        $MESHMILL run recipe.toml --pictures none --out ro-0 --cache first --cache lab
        $MESHMILL cache push --cache first --cache lab
        mount -o remount,ro none lab
        $MESHMILL run recipe.toml --pictures none --out ro-1 --cache third --cache lab
        printf 'v 0 0 2\\n' >>cube.obj
        $MESHMILL run recipe.toml --pictures none --out ro-2 --cache third --cache lab
        mkdir empty; mount -t tmpfs -o ro none empty
        if $MESHMILL run recipe.toml --out none --cache empty; then exit 99; else echo code $?; fi";
    let output = with_mounts(&desk, "a read-only folder", read_only).unwrap();
    let said = text(&output);
    assert!(output.status.success() && said.contains("code 6"), "{said}");
    assert_eq!(said.matches("nothing more is written to the level lab").count(), 1, "{said}");
    same("ro-1");
}

/// Writes that fail as they do when a quota is used up, for files below `lab`.
#[cfg(target_os = "linux")]
const QUOTA: &str = r#"
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
ssize_t write(int file, const void *bytes, size_t count) {
  char link[64], path[4096];
  snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  ssize_t length = readlink(link, path, sizeof path - 1);
  if (length > 0) {
    path[length] = 0;
    if (strstr(path, "/lab/v2/tmp/")) { errno = EDQUOT; return -1; }
  }
  return ((ssize_t (*)(int, const void *, size_t))dlsym(RTLD_NEXT, "write"))(file, bytes, count);
}
"#;

#[cfg(target_os = "linux")]
#[test]
fn a_quota_that_is_used_up_is_as_a_full_folder() {
    let desk = desk();
    run(&desk, "expected", &["first"]).assert().success();
    desk.write("quota.c", QUOTA);
    let library = desk.path("quota.so");
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-o"]).arg(&library).arg(desk.path("quota.c")).arg("-ldl");
    if !compiler.status().is_ok_and(|status| status.success()) {
        skipped("a quota: there is no compiler of C");
        return;
    }
    let limited = run(&desk, "out", &["second", "lab"]).env("LD_PRELOAD", &library).assert().success();
    let said = text(limited.get_output());
    assert_eq!(said.matches("nothing more is written to the level lab").count(), 1, "{said}");
    assert!(said.to_lowercase().contains("quota"), "{said}");
    assert_eq!(fs::read(desk.path("out/result.stl")).unwrap(), fs::read(desk.path("expected/result.stl")).unwrap());
    assert_eq!(fs::read_dir(desk.path("lab/v2/tmp")).unwrap().count(), 0, "a part of a file was left");
}

#[cfg(target_os = "linux")]
#[test]
fn users_of_one_group_share_a_folder_whatever_their_umask() {
    use std::os::unix::fs::{MetadataExt, PermissionsExt};
    let desk = desk();
    let script = "set -e; chgrp 2000 lab; chmod 2775 lab
        for user in 1001 1002; do
          mkdir user-$user; cp recipe.toml cube.obj user-$user; chown -R $user user-$user
          ( cd user-$user; umask 077
            setpriv --reuid $user --regid $user --groups 2000 \
              $MESHMILL run recipe.toml --pictures none --json --out out --cache own --cache ../lab )
        done";
    let mut command = Command::new("sh");
    command.current_dir(desk.path("")).env("MESHMILL", program(&desk)).args(["-c", script]);
    if fs::metadata(desk.path("")).unwrap().uid() != 0 {
        skipped("two users: only root can become them");
        return;
    }
    let output = command.output().unwrap();
    let said = text(&output);
    assert!(output.status.success(), "{said}");
    let reports: Vec<serde_json::Value> =
        serde_json::Deserializer::from_slice(&output.stdout).into_iter().map(Result::unwrap).collect();
    assert_eq!(reports.iter().map(ran_of).collect::<Vec<_>>(), [3, 0], "{said}");
    let mut folders = vec![desk.path("lab")];
    while let Some(folder) = folders.pop() {
        let check = |path: &Path, mode: u32| {
            let meta = fs::metadata(path).unwrap();
            let found = (meta.permissions().mode() & 0o7777, meta.gid());
            assert_eq!(found, (mode, 2000), "{:o} {}", found.0, path.display());
        };
        check(&folder, 0o2775);
        for path in fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()) {
            if path.is_dir() { folders.push(path) } else { check(&path, 0o664) }
        }
    }
}
