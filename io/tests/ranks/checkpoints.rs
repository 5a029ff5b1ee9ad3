//! Checkpoints written on some ranks and read on others.

use crate::{run_ranks, text};
use io::checkpoint::{self, Checkpoint, Group, State, Values};
use partition::Communicator;
use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

pub fn test(directory: &Path) {
    any_number_of_ranks_reads_what_any_number_wrote(directory);
    two_are_kept_and_later_ones_go(directory);
    damage_is_named(directory);
    what_is_not_there_is_named(directory);
}

fn any_number_of_ranks_reads_what_any_number_wrote(directory: &Path) {
    for (writers, readers) in [(2, 2), (2, 1), (2, 3), (3, 2), (1, 3), (3, 1)] {
        let dir = directory.join(format!("checkpoints-{writers}-{readers}"));
        run_ranks(writers, &["write-checkpoint", text(&dir), "12"]);
        run_ranks(readers, &["read-checkpoint", text(&dir), &writers.to_string()]);
    }
}

fn two_are_kept_and_later_ones_go(directory: &Path) {
    let dir = directory.join("checkpoints-kept");
    let there = || {
        let mut names: Vec<_> = fs::read_dir(&dir)
            .expect("the directory is there")
            .map(|entry| entry.expect("it can be listed").file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    for step in [10, 20, 30, 40] {
        save(&Communicator::single(), &dir, step);
    }
    assert_eq!(there(), ["checkpoint-00000030", "checkpoint-00000040"]);
    // A run that died while it wrote, and one restarted from step 30.
    fs::create_dir(dir.join("checkpoint-00000050.unfinished")).expect("a directory can be made");
    fs::create_dir(dir.join("checkpoint-notes")).expect("a directory can be made");
    assert_eq!(checkpoint::find(&dir), Some(dir.join("checkpoint-00000040")));
    save(&Communicator::single(), &dir, 35);
    assert_eq!(there(), ["checkpoint-00000030", "checkpoint-00000035", "checkpoint-notes"]);
    save(&Communicator::single(), &dir, 35);
    assert_eq!(checkpoint::find(&dir), Some(dir.join("checkpoint-00000035")));
    assert_eq!(checkpoint::find(&dir.join("checkpoint-notes")), None);
}

fn damage_is_named(directory: &Path) {
    let comm = Communicator::single();
    let fresh = |name: &str| {
        let path = save(&comm, &directory.join(name), 1);
        (path.join("rank-0000.h5"), path)
    };
    let opened = |path: &Path| Checkpoint::open(&comm, path).unwrap_err().to_string();

    let (file, path) = fresh("checkpoints-truncated");
    let bytes = fs::read(&file).expect("the file is there");
    fs::write(&file, &bytes[..bytes.len() - 100]).expect("it can be written");
    let (all, found) = (bytes.len(), bytes.len() - 100);
    let expected = format!("{}: has {found} bytes, {all} were written", file.display());
    assert_eq!(opened(&path), expected);

    fs::remove_file(&file).expect("it can be removed");
    assert!(opened(&path).starts_with(text(&file)), "{}", opened(&path));

    let (file, path) = fresh("checkpoints-corrupt");
    let mut bytes = fs::read(&file).expect("the file is there");
    let value = value(N as u64 / 2, 0).to_ne_bytes();
    let at = bytes.windows(8).position(|window| window == value).expect("the value is in the file");
    bytes[at] ^= 1;
    fs::write(&file, &bytes).expect("it can be written");
    let error = Checkpoint::open(&comm, &path)
        .and_then(|it| it.read_f64("nodes", "velocity", 3, &[0]))
        .unwrap_err()
        .to_string();
    assert!(error.starts_with(text(&file)) && error.contains("nodes/velocity"), "{error}");

    let (_, path) = fresh("checkpoints-manifest");
    let manifest = path.join("checkpoint.toml");
    let good = fs::read_to_string(&manifest).expect("the file is there");
    fs::write(&manifest, good.replace("step = 1", "step = one")).expect("it can be written");
    assert!(opened(&path).starts_with(&format!("{}:3: ", manifest.display())), "{}", opened(&path));
    fs::write(&manifest, good.replace("format = 1", "format = 9")).expect("it can be written");
    assert!(opened(&path).contains("format 9"), "{}", opened(&path));
    let nowhere = path.join("nowhere");
    assert!(opened(&nowhere).starts_with(text(&nowhere)), "{}", opened(&nowhere));
}

fn what_is_not_there_is_named(directory: &Path) {
    let comm = Communicator::single();
    let path = save(&comm, &directory.join("checkpoints-asked"), 1);
    let it = Checkpoint::open(&comm, &path).expect("it is whole");
    let n = N as u64;
    for (error, part) in [
        (it.read_f64("nodes", "velocity", 3, &[0, n + 3, n + 1]), "2 of the nodes asked for"),
        (it.read_f64("nodes", "velocity", 3, &[0, n + 3, n + 1]), "the first is 5001"),
        (it.read_f64("nodes", "velocity", 2, &[0]), "not (n, 2)"),
        (it.read_f64("nodes", "birthday", 1, &[0]), "nodes/birthday"),
        (it.read_f64("nodes", "flags", 1, &[0]), "holds no f64"),
    ] {
        let error = error.unwrap_err().to_string();
        assert!(error.starts_with(text(&path)) && error.contains(part), "{error}");
    }
    assert!(it.scalar("dy").unwrap_err().to_string().contains("has no scalar `dy`"));
}

/// The writer's job: directory, step.
pub fn write(comm: &Communicator, arguments: &[String]) {
    let [dir, step] = arguments else { panic!("two arguments") };
    save(comm, Path::new(dir), step.parse().expect("a step"));
}

/// The reader's job: directory, number of ranks that wrote.
pub fn read(comm: &Communicator, arguments: &[String]) {
    let [dir, writers] = arguments else { panic!("two arguments") };
    let path = checkpoint::find(Path::new(dir)).expect("there is a checkpoint");
    let it = Checkpoint::open(comm, &path).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((it.step(), it.time(), it.case()), (12, 12.0 / 7.0, "a case"));
    assert_eq!(it.ranks().to_string(), *writers);
    assert_eq!(it.count("nodes"), Some(N as u64));
    assert_eq!(it.scalar("dt").map(f64::to_bits).ok(), Some((0.1f64 + 0.2).to_bits()));
    // Owned ones alone (on as many ranks as wrote: the rank's own file), then a halo as well.
    let owned = owned(comm);
    let with_halo: Vec<u64> = owned.iter().copied().chain([0, 0, N as u64 - 1]).collect();
    for ids in [owned, with_halo] {
        let velocity = it.read_f64("nodes", "velocity", 3, &ids).unwrap_or_else(|e| panic!("{e}"));
        let flags = it.read_u64("nodes", "flags", 1, &ids).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((velocity.len(), flags.len()), (3 * ids.len(), ids.len()));
        for (i, &id) in ids.iter().enumerate() {
            let found = [0, 1, 2].map(|c| velocity[3 * i + c].to_bits());
            assert_eq!(found, [0, 1, 2].map(|c| value(id, c).to_bits()));
            assert_eq!(flags[i], id.wrapping_mul(id) << 20);
        }
    }
    // A group of which the first rank alone has anything.
    let few = if comm.rank() + 1 == comm.size() { vec![0, 1] } else { vec![] };
    let mass = it.read_f64("bodies", "mass", 1, &few).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(mass, [3.5, 4.5][..few.len()]);
}

const N: usize = 5000;

fn value(id: u64, component: u64) -> f64 {
    ((3 * id + component) as f64).sin() * 1e-3
}

/// Unequal shares, not in order.
fn owned(comm: &Communicator) -> Vec<u64> {
    let end = |rank: usize| N * rank * rank / comm.size() / comm.size();
    let Range { start, end } = end(comm.rank())..end(comm.rank() + 1);
    (start..end).rev().map(|id| (id * 7 % N) as u64).collect()
}

fn save(comm: &Communicator, dir: &Path, step: u64) -> PathBuf {
    let ids = owned(comm);
    let mut velocity: Vec<f64> =
        ids.iter().flat_map(|&id| [0, 1, 2].map(|c| value(id, c))).collect();
    velocity.extend([f64::NAN; 30]); // ghosts, which are not saved
    let flags: Vec<u64> = ids.iter().map(|id| id.wrapping_mul(*id) << 20).collect();
    let few: &[u64] = if comm.rank() == 0 { &[0, 1] } else { &[] };
    let mass: &[f64] = if comm.rank() == 0 { &[3.5, 4.5] } else { &[] };
    let nodes = [("velocity", 3, Values::F64(&velocity)), ("flags", 1, Values::U64(&flags))];
    let state = State {
        case: "a case",
        step,
        time: step as f64 / 7.0,
        scalars: &[("dt", 0.1 + 0.2)],
        groups: &[
            Group { name: "nodes", ids: &ids, arrays: &nodes },
            Group { name: "bodies", ids: few, arrays: &[("mass", 1, Values::F64(mass))] },
        ],
    };
    checkpoint::write(comm, dir, &state).unwrap_or_else(|e| panic!("{e}"))
}
