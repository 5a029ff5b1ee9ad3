//! A disk that fills up: one sentence, status 1, no crash, and the last checkpoint is as good as ever.

use io::checkpoint::find;
use std::path::PathBuf;
use std::process::{Command, Output};

const CASE: &str = r#"
[mesh]
box = { x = [0, 1], y = [0, 0.5], z = [0, 0.5], cells = [8, 4, 4] }

[boundaries]
default = "slip"
z_max = "open"

[initial]
water = "x < 0.35 && z < 0.4"

[air]

[time]
end = 0.6
step = 0.01

[output]
fields_every = 0.01
checkpoint_every = 0.02
"#;

#[test]
fn a_file_that_cannot_grow_ends_the_run_in_one_sentence_and_it_goes_on_when_it_can() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("full_disk");
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("case.toml"), CASE).unwrap();
    let run = |limit: &str, more: &str| -> Output {
        // A limit in blocks of 512 bytes stands for the disk's end; the signal that comes with it is not the disk's.
        let script = format!(
            "ulimit -f {limit}; trap '' XFSZ; exec {} case.toml --quiet {more}",
            env!("CARGO_BIN_EXE_fcm-fsi")
        );
        // By mpirun, or the limit is that of Open MPI's own files too.
        let mut command = Command::new("mpirun");
        command.args(["-q", "-n", "1", "sh", "-c", &script]).current_dir(&folder);
        command.env("OMPI_ALLOW_RUN_AS_ROOT", "1").env("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1");
        command.output().expect("mpirun starts")
    };
    let full = run("600", "--out results");
    let said = String::from_utf8_lossy(&full.stderr);
    assert_eq!(full.status.code(), Some(1), "{said}");
    // Open MPI has something to say of its own.
    let errors: Vec<&str> = said.lines().filter(|line| line.starts_with("error: ")).collect();
    assert_eq!(errors.len(), 1, "{said}");
    assert!(errors[0].starts_with("error: results/fields.vtkhdf: cannot write "), "{said}");
    assert!(find(&folder.join("results")).is_some(), "a checkpoint from before");

    let on = run("unlimited", "--restart results --out again");
    assert!(on.status.success(), "{}", String::from_utf8_lossy(&on.stderr));
}
