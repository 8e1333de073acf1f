//! What more than one level promises: later ones fill earlier ones, trouble is passed over, other versions are left
//! alone.

use std::collections::BTreeSet;

use super::*;

/// A store of so many folders, each in a folder of its own below the first value.
fn levels(count: usize) -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    let specs: Vec<LevelSpec> =
        (0..count).map(|number| LevelSpec::folder(&folder.path().join(format!("l{number}")))).collect();
    for number in 1..count {
        fs::create_dir(folder.path().join(format!("l{number}"))).unwrap();
    }
    let store = Store::with_levels(&specs).unwrap();
    (folder, store)
}

fn of_level(folder: &tempfile::TempDir, number: usize) -> Store {
    Store::open(&folder.path().join(format!("l{number}"))).unwrap()
}

/// An entry and a blob of a level, and no more.
const ONE: (u64, u64) = (1, 1);

fn count(store: &Store) -> (u64, u64) {
    let stat = store.stat(0).unwrap();
    (stat.entries, stat.blobs)
}

#[test]
fn what_is_made_is_in_every_level_and_what_is_found_fills_the_earlier_ones() {
    let (folder, store) = levels(3);
    let (key, saved) = fill(&store, 1)[0];
    for number in 0..3 {
        assert_eq!(count(&of_level(&folder, number)), ONE, "level {number}");
    }
    of_level(&folder, 0).clear(0).unwrap();
    of_level(&folder, 1).clear(0).unwrap();
    assert_eq!(store.entry(&key), Some(entry(saved)));
    assert_eq!(count(&of_level(&folder, 0)), (1, 0), "artifacts come when they are asked for");
    assert!(store.load(&saved.content).is_some());
    for number in 0..2 {
        let level = of_level(&folder, number);
        assert_eq!(count(&level), ONE);
        assert!(level.entry(&key).is_some() && level.load(&saved.content).is_some());
    }
}

#[test]
fn damage_in_any_level_is_made_good_by_the_next_and_never_copied() {
    let (folder, store) = levels(3);
    let (key, saved) = fill(&store, 1)[0];
    for (kind, hash) in [(Kind::Entry, &key), (Kind::Blob, &saved.content)] {
        for number in 0..2 {
            let path = of_level(&folder, number).home.place(kind, hash);
            let bytes = fs::read(&path).unwrap();
            fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        }
    }
    assert!(store.entry(&key).is_some() && store.load(&saved.content).is_some());
    for number in 0..3 {
        let level = of_level(&folder, number);
        assert_eq!((count(&level), level.verify(0).unwrap()), (ONE, CleanReport::default()), "level {number}");
    }
    for number in 0..3 {
        fs::write(of_level(&folder, number).home.place(Kind::Blob, &saved.content), "nonsense").unwrap();
    }
    assert!(store.load(&saved.content).is_none());
}

#[test]
fn a_level_that_vanishes_is_passed_over_and_not_made_anew() {
    let (folder, store) = levels(2);
    fill(&store, 1);
    fs::remove_dir_all(folder.path().join("l1")).unwrap();
    let items = fill(&store, 3);
    assert!(items.iter().all(|(key, saved)| store.entry(key).is_some() && store.load(&saved.content).is_some()));
    assert!(!folder.path().join("l1").exists());
    // From the beginning, too.
    let specs = ["l0", "l1"].map(|name| LevelSpec::folder(&folder.path().join(name)));
    let store = Store::with_levels(&specs).unwrap();
    assert!(store.entry(&items[0].0).is_some() && store.entry(&blake3::hash(b"unknown")).is_none());
    assert!(!folder.path().join("l1").exists());
}

#[test]
fn a_level_that_is_read_only_is_read_and_never_written() {
    let (folder, store) = levels(2);
    let (key, saved) = fill(&store, 1)[0];
    fs::remove_dir_all(folder.path().join("l0")).unwrap();
    let damaged = blake3::hash(b"damaged");
    let path = of_level(&folder, 1).home.place(Kind::Entry, &damaged);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(&path, "nonsense").unwrap();
    let shared = LevelSpec { read_only: true, ..LevelSpec::folder(&folder.path().join("l1")) };
    let specs = [LevelSpec::folder(&folder.path().join("l0")), shared.clone()];
    let store = Store::with_levels(&specs).unwrap();
    assert!(store.entry(&key).is_some() && store.load(&saved.content).is_some());
    assert!(store.entry(&damaged).is_none() && path.exists());
    fill(&store, 5);
    assert_eq!((count(&of_level(&folder, 0)), count(&of_level(&folder, 1))), ((5, 5), (2, 1)));
    assert!(matches!(store.copy(0, 1, true), Err(StoreError::Level { .. })));
    let alone = [LevelSpec::folder(&folder.path().join("file/below")), shared];
    fs::write(folder.path().join("file"), "").unwrap();
    assert!(Store::with_levels(&alone).is_err(), "no level can be written");
}

#[test]
fn the_first_level_may_be_the_one_in_trouble() {
    let (folder, store) = levels(2);
    let (key, saved) = fill(&store, 1)[0];
    fs::write(folder.path().join("file"), "").unwrap();
    let specs = [folder.path().join("file"), folder.path().join("l1")].map(|path| LevelSpec::folder(&path));
    let store = Store::with_levels(&specs).unwrap();
    assert_eq!(store.root(), folder.path().join("l1"));
    assert!(store.entry(&key).is_some() && store.load(&saved.content).is_some());
    fill(&store, 2);
    assert_eq!(count(&of_level(&folder, 1)), (2, 2));
}

#[test]
fn an_entry_of_an_earlier_version_serves_and_that_of_a_newer_one_is_left_alone() {
    let (_folder, store) = store();
    let (key, saved) = fill(&store, 1)[0];
    let path = store.home.place(Kind::Entry, &key);
    let document = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut value = serde_json::to_value(entry(saved)).unwrap();
        change(&mut value);
        seal::seal(key.as_bytes(), &serde_json::to_vec(&value).unwrap())
    };
    fs::write(&path, document(&|value| drop(value.as_object_mut().unwrap().remove("host")))).unwrap();
    assert_eq!(store.entry(&key), Some(Entry { host: String::new(), ..entry(saved) }));
    fs::write(&path, document(&|value| value["to-come"] = serde_json::json!({ "a": 1 }))).unwrap();
    assert_eq!(store.entry(&key), Some(entry(saved)));
    // What this version cannot read is a miss, neither damaged nor collected, and its blob may be named by it.
    let newer: [Vec<u8>; 2] = [
        document(&|value| value["outcome"] = serde_json::json!({ "to-come": 1 })),
        [b"meshmill-sealed-2 ".as_slice(), &[b'0'; 64], b"\nbody"].concat(),
    ];
    let blob = store.home.place(Kind::Blob, &blake3::hash(b"of a newer version"));
    fs::create_dir_all(blob.parent().unwrap()).unwrap();
    fs::write(&blob, b"mmblob2\nwhatever").unwrap();
    age(&blob, 100_000);
    for bytes in newer {
        fs::write(&path, bytes).unwrap();
        assert_eq!(store.entry(&key), None);
        let report = store.verify(0).unwrap();
        assert_eq!((report.foreign, report.damaged.len()), (2, 0));
        store.gc(0, GcLimits::default()).unwrap();
        assert!(path.exists() && blob.exists());
        assert!(store.home.place(Kind::Blob, &saved.content).exists());
    }
    age(&path, 5000);
    let limits = GcLimits { max_age: Some(Duration::from_secs(4000)), ..GcLimits::default() };
    assert_eq!(store.gc(0, limits).unwrap().entries, 1, "age takes everything");
}

#[test]
fn what_a_lock_pins_stays_until_the_lock_is_gone() {
    let (folder, store) = levels(2);
    let items = fill(&store, 3);
    let lock = folder.path().join("part.lock.ron");
    fs::write(&lock, "lock").unwrap();
    let keys = |numbers: &[usize]| -> BTreeSet<String> {
        numbers.iter().map(|number| items[*number].0.to_hex().to_string()).collect()
    };
    store.pin(&lock, "1", &keys(&[0, 2])).unwrap();
    store.pin(&lock, "1", &keys(&[1])).unwrap();
    let everything = GcLimits { max_bytes: Some(0), ..GcLimits::default() };
    for number in 0..2 {
        let report = store.gc(number, everything).unwrap();
        assert_eq!((report.entries, report.blobs, report.pinned), (2, 2, 1), "locking anew replaces the pin");
        assert_eq!(store.pins(number).unwrap()[0].keys.len(), 1);
    }
    assert!(store.entry(&items[1].0).is_some() && store.load(&items[1].1.content).is_some());
    assert_eq!(store.unpin(1, &lock.display().to_string()).unwrap(), 1);
    assert_eq!(store.gc(1, everything).unwrap().entries, 1);
    fs::remove_file(&lock).unwrap();
    assert_eq!(store.gc(0, GcLimits { dry_run: true, ..everything }).unwrap().entries, 1);
    assert_eq!(store.pins(0).unwrap().len(), 1, "a dry run removes nothing");
    assert_eq!(store.gc(0, everything).unwrap().entries, 1);
    assert!(store.pins(0).unwrap().is_empty());
}

#[test]
fn copies_are_whole_and_sound() {
    let (folder, both) = levels(2);
    let first = of_level(&folder, 0);
    let items = fill(&first, 4);
    fs::write(first.home.place(Kind::Blob, &items[1].1.content), "nonsense").unwrap();
    fs::write(first.home.place(Kind::Entry, &items[2].0), "nonsense").unwrap();
    first.pin(&folder.path().join("lock"), "1", &BTreeSet::new()).unwrap();
    let report = both.copy(0, 1, true).unwrap();
    assert_eq!((report.entries, report.blobs, report.present, report.left_out), (2, 2, 0, 2));
    let second = of_level(&folder, 1);
    assert_eq!((count(&second), second.pins(0).unwrap().len()), ((2, 2), 1));
    assert!(second.load(&items[3].1.content).is_some() && second.entry(&items[1].0).is_none());
    let again = both.copy(0, 1, true).unwrap();
    assert_eq!((again.entries, again.blobs, again.present), (0, 0, 2));
    first.clear(0).unwrap();
    assert_eq!(both.copy(1, 0, false).unwrap().entries, 2);
    assert_eq!(first.makers(0).unwrap().into_iter().collect::<Vec<_>>(), [(("0".to_owned(), "node7".to_owned()), 2)]);
}

#[cfg(unix)]
#[test]
fn rights_are_those_of_the_folder() {
    use std::os::unix::fs::PermissionsExt;
    let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o7777;
    for (root, folders, files) in [(0o2775, 0o2775, 0o664), (0o700, 0o700, 0o600), (0o755, 0o755, 0o644)] {
        let folder = tempfile::tempdir().unwrap();
        fs::set_permissions(folder.path(), fs::Permissions::from_mode(root)).unwrap();
        let store = Store::open(folder.path()).unwrap();
        let (key, saved) = fill(&store, 1)[0];
        for path in [store.home.place(Kind::Entry, &key), store.home.place(Kind::Blob, &saved.content)] {
            let shard = path.parent().unwrap();
            let found = [mode(&path), mode(shard), mode(shard.parent().unwrap()), mode(&store.home.folder("tmp"))];
            assert_eq!(found, [files, folders, folders, folders], "{root:o}");
        }
    }
}
