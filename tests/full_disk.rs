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
end = 0.2
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
    for ranks in ["1", "2"] {
        let out = format!("{ranks}_ranks");
        let run = |limit: &str, more: &str| -> Output {
            // A limit of 512-byte blocks stands for the disk's end; the signal that comes with it is not the disk's.
            let script = format!(
                "ulimit -f {limit}; trap '' XFSZ; exec mpirun -q -n {ranks} {} case.toml --out {out} --quiet {more}",
                env!("CARGO_BIN_EXE_fcm-fsi")
            );
            let mut command = Command::new("sh");
            command.args(["-c", &script]).current_dir(&folder);
            for name in ["ALLOW_RUN_AS_ROOT", "ALLOW_RUN_AS_ROOT_CONFIRM"] {
                command.env(format!("OMPI_{name}"), "1");
            }
            command.env("OMPI_MCA_rmaps_base_oversubscribe", "1");
            command.env("OMPI_MCA_mpi_yield_when_idle", "1").output().expect("sh starts")
        };
        let full = run("300", "");
        let said = String::from_utf8_lossy(&full.stderr);
        assert_eq!(full.status.code(), Some(1), "{said}");
        let expected = format!("error: {out}/fields.vtkhdf: cannot ");
        assert!(said.starts_with(&expected), "{said}");
        assert!(said.trim_end().ends_with(": File too large"), "{said}");
        assert_eq!(said.trim_end().lines().count(), 1, "{said}");
        assert!(find(&folder.join(&out)).is_some(), "a checkpoint from before");

        let on = run("unlimited", &format!("--restart {out}"));
        assert!(on.status.success(), "{}", String::from_utf8_lossy(&on.stderr));
    }
}
