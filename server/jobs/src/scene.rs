//! Scene of a job: text and the files that it names (meshes, recorded motions), checked before the job is accepted.

use std::collections::BTreeSet;
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use plica_protocol::jobs::JobSubmitRequest;
use plica_scene::Config;
use plica_scene::scene::MAX_FILE_BYTES;
use plica_training::{FileFault, JobPaths, RegularFile, write_atomically};

use crate::error::JobError;

/// Most bytes of all files that a job's scene names.
const MAX_FILES_BYTES: u64 = 128 << 20;
const MIB: u64 = 1 << 20;

/// Scene that the daemon serves, as read from its file.
#[derive(Debug, Clone)]
pub struct ServedScene {
    /// Its name.
    pub name: String,
    /// Folder of the files that it names; `None` for the built-in scene.
    pub folder: Option<PathBuf>,
    /// Its text.
    pub text: String,
}

/// A scene whose text is checked; none of its files has been opened.
#[derive(Debug)]
pub(crate) struct JobScene<'a> {
    pub(crate) name: String,
    text: &'a str,
    /// Folder of its files.
    folder: Option<&'a Path>,
    /// Files to copy, as typed, each once.
    files: BTreeSet<PathBuf>,
}

impl<'a> JobScene<'a> {
    /// Scene of a request, or the served one if the request has none.
    ///
    /// The daemon's own scene may name files by absolute paths; they are not copied.
    pub(crate) fn new(request: &'a JobSubmitRequest, served: &'a ServedScene) -> Result<Self, JobError> {
        let is_own = request.scene.is_none();
        let (name, text) = match &request.scene {
            Some(text) => (request.scene_name.as_deref().unwrap_or("scene"), text),
            None => (served.name.as_str(), &served.text),
        };
        let named = Config::files_of(&file_of(name), text).map_err(|error| JobError::Scene(error.to_string()))?;
        let wanted =
            named.into_iter().map(|file| file.typed).filter(|typed| !(is_own && Path::new(typed).is_absolute()));
        let files = wanted.map(|typed| plain(&typed)).collect::<Result<_, _>>()?;
        Ok(Self { name: name.to_owned(), text, folder: served.folder.as_deref(), files })
    }

    /// Writes `scene.toml` and the files that it names into a job's folder, and checks the scene there, with its meshes.
    pub(crate) fn write(&self, paths: &JobPaths) -> Result<(), JobError> {
        let stored = |error: io::Error| JobError::Disk(error.to_string());
        write_atomically(&paths.scene(), self.text.as_bytes()).map_err(stored)?;
        let mut left = MAX_FILES_BYTES;
        for typed in &self.files {
            let bytes = self.read(typed, left)?;
            left -= bytes.len() as u64;
            let copy = paths.root().join(typed);
            fs::create_dir_all(copy.parent().unwrap_or(paths.root())).map_err(stored)?;
            write_atomically(&copy, &bytes).map_err(stored)?;
        }
        Config::parse(&paths.root().join(file_of(&self.name)), self.text).map(drop).map_err(|mut error| {
            error.file = file_of(&self.name);
            JobError::Scene(error.to_string())
        })
    }

    /// Content of a file beside or below the served scene, if it has at most `left` bytes.
    fn read(&self, typed: &Path, left: u64) -> Result<Vec<u8>, JobError> {
        let refuse = |why: String| refused(&typed.to_string_lossy(), &why);
        let Some(folder) = self.folder else {
            return Err(refuse("the built-in scene is served, which has no folder to take files from".into()));
        };
        let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
        let beside = |e: io::Error| refuse(format!("it cannot be read beside the served scene: {e}"));
        let folder = folder.canonicalize().map_err(beside)?;
        let path = folder.join(typed).canonicalize().map_err(beside)?;
        if !path.starts_with(&folder) {
            return Err(refuse("a link leads out of the served scene's folder; copy the file there".into()));
        }
        let read = RegularFile::open_unlinked(&path, MAX_FILE_BYTES.min(left)).and_then(RegularFile::read);
        read.map_err(|fault| match fault {
            FileFault::Large { bytes, most } if most < MAX_FILE_BYTES => {
                let most = MAX_FILES_BYTES / MIB;
                refuse(format!("with its {bytes} bytes the files of the scene have more than {most} MiB together"))
            }
            FileFault::Large { bytes, .. } => {
                refuse(format!("it has {bytes} bytes; at most {} MiB are copied", MAX_FILE_BYTES / MIB))
            }
            other => refuse(format!("it {other}")),
        })
    }
}

fn refused(typed: &str, why: &str) -> JobError {
    JobError::Scene(format!("file = \"{typed}\": {why}"))
}

fn file_of(name: &str) -> PathBuf {
    PathBuf::from(format!("{name}.toml"))
}

/// A path that stays below its folder and does not collide with a job's own files, in one spelling.
fn plain(typed: &str) -> Result<PathBuf, JobError> {
    let mut parts = Path::new(typed).components();
    let is_down = !typed.is_empty() && parts.clone().all(|part| matches!(part, Component::Normal(_)));
    if is_down && parts.next().is_some_and(|first| !JobPaths::is_reserved(first.as_os_str())) {
        return Ok(Path::new(typed).components().collect());
    }
    Err(refused(typed, "files of a job's scene must lie beside the served scene or below it"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

    use super::*;
    use plica_protocol::jobs::JobKind;
    use plica_scene::BUILT_IN_SCENE;

    const TETRAHEDRON: &str = "v 0 0 0\nv 0.01 0 0\nv 0 0.01 0\nv 0 0 0.01\nf 1 2 3\nf 1 2 4\n";

    fn with_mesh(file: &str) -> String {
        let mesh = format!("shape = {{ mesh = {{ file = \"{file}\", metres_per_unit = 1.0 }} }}");
        let line = BUILT_IN_SCENE.lines().find(|line| line.starts_with("shape = { capsule")).unwrap();
        BUILT_IN_SCENE.replace(line, &mesh)
    }

    fn served(folder: &Path) -> ServedScene {
        fs::create_dir_all(folder.join("tools")).unwrap();
        fs::write(folder.join("tools/rod.obj"), TETRAHEDRON).unwrap();
        ServedScene { name: "wedge".to_owned(), folder: Some(folder.to_owned()), text: with_mesh("tools/rod.obj") }
    }

    fn submitted(text: String) -> JobSubmitRequest {
        let name = Some("mine".to_owned());
        JobSubmitRequest { scene: Some(text), scene_name: name, ..JobSubmitRequest::new("a", JobKind::Training) }
    }

    #[test]
    fn files_are_copied() {
        let (folder, job) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let served = served(folder.path());
        let request = JobSubmitRequest::new("a", JobKind::Training);
        let paths = JobPaths::new(job.path().to_owned());
        JobScene::new(&request, &served).unwrap().write(&paths).unwrap();
        assert_eq!(fs::read_to_string(job.path().join("tools/rod.obj")).unwrap(), TETRAHEDRON);
        assert_eq!(fs::read_to_string(paths.scene()).unwrap(), served.text);
        Config::from_file(&paths.scene()).unwrap();
        assert_eq!(JobScene::new(&submitted(with_mesh("tools/rod.obj")), &served).unwrap().name, "mine");
    }

    /// The refusal of a request, from its text or from its files.
    fn refusal(request: &JobSubmitRequest, served: &ServedScene) -> String {
        let job = tempfile::tempdir().unwrap();
        let paths = JobPaths::new(job.path().to_owned());
        let written = JobScene::new(request, served).and_then(|scene| scene.write(&paths));
        let message = written.unwrap_err().to_string();
        assert!(!message.contains(job.path().to_str().unwrap()), "{message}");
        message
    }

    fn with_meshes(files: &[&str]) -> String {
        let tool = |(i, file): (usize, &&str)| {
            format!("[tools.t{i}]\nshape = {{ mesh = {{ file = \"{file}\", metres_per_unit = 1.0 }} }}\n")
        };
        format!("{}\n{}", with_mesh(files[0]), files.iter().enumerate().map(tool).collect::<String>())
    }

    #[test]
    fn a_file_is_read_once_however_often_it_is_named_and_none_before_the_text_is_checked() {
        let folder = tempfile::tempdir().unwrap();
        let served = served(folder.path());
        let request = submitted(with_meshes(&["tools/rod.obj", "tools//rod.obj", "tools/./rod.obj"]));
        assert_eq!(JobScene::new(&request, &served).unwrap().files.len(), 1);
        let many: Vec<&str> = vec!["tools/none.obj"; 20_000];
        let message = refusal(&submitted(with_meshes(&many)), &served);
        assert!(message.contains("20001 tools; the allowed range is 0 to 16"), "{message}");
    }

    #[test]
    fn files_are_bounded_one_by_one_and_together() {
        let folder = tempfile::tempdir().unwrap();
        let served = served(folder.path());
        let sized = |name: &str, bytes: u64| {
            fs::File::create(folder.path().join(name)).unwrap().set_len(bytes).unwrap();
        };
        sized("large.obj", MAX_FILE_BYTES + 1);
        let message = refusal(&submitted(with_mesh("large.obj")), &served);
        assert_eq!(message, "file = \"large.obj\": it has 67108865 bytes; at most 64 MiB are copied");
        for name in ["a.obj", "b.obj", "c.obj"] {
            sized(name, MAX_FILES_BYTES / 3 + 1);
        }
        let message = refusal(&submitted(with_meshes(&["a.obj", "b.obj", "c.obj"])), &served);
        assert!(message.starts_with("file = \"c.obj\": with its 44739243 bytes"), "{message}");
        assert!(message.ends_with("more than 128 MiB together"), "{message}");
    }

    #[test]
    fn only_regular_files_within_the_folder_are_copied() {
        let (folder, outside) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
        let served = served(folder.path());
        let secret = outside.path().join("secret.obj");
        fs::write(&secret, "v hunter2 0 0\n").unwrap();
        std::os::unix::fs::symlink(&secret, folder.path().join("out.obj")).unwrap();
        std::os::unix::fs::symlink("/dev/zero", folder.path().join("zero.obj")).unwrap();
        std::os::unix::fs::symlink("tools/rod.obj", folder.path().join("in.obj")).unwrap();
        let pipe = std::process::Command::new("mkfifo").arg(folder.path().join("pipe.obj")).status();
        assert!(pipe.unwrap().success());
        for (bad, why) in [("out.obj", "leads out"), ("zero.obj", "leads out"), ("pipe.obj", "no regular file")] {
            let message = refusal(&submitted(with_mesh(bad)), &served);
            assert!(message.contains(why) && !message.contains("hunter2"), "{message}");
            assert!(!message.contains(outside.path().to_str().unwrap()), "{message}");
        }
        let job = tempfile::tempdir().unwrap();
        let request = submitted(with_mesh("in.obj"));
        JobScene::new(&request, &served).unwrap().write(&JobPaths::new(job.path().to_owned())).unwrap();
    }

    #[test]
    fn words_of_a_file_are_not_in_its_errors() {
        let folder = tempfile::tempdir().unwrap();
        let served = served(folder.path());
        for secret in ["v hunter2 0 0\n", "v 0 0 0\nf hunter2 1 1\n", "hunter2\n", "v 0 0 0\no hunter2\nf 1 1 1\n"] {
            fs::write(folder.path().join("secret.obj"), secret).unwrap();
            let message = refusal(&submitted(with_mesh("secret.obj")), &served);
            assert!(message.contains("secret.obj") && message.contains("mine.toml:"), "{message}");
            assert!(!message.contains("hunter2"), "{message}");
            assert!(!message.contains(folder.path().to_str().unwrap()), "{message}");
        }
    }

    #[test]
    fn files_from_elsewhere_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let served = served(folder.path());
        fs::write(folder.path().join("examples"), "").unwrap();
        let secret = folder.path().join("tools/rod.obj");
        for bad in ["../rod.obj", "/dev/zero", secret.to_str().unwrap(), "tools", "no.obj", "examples", "job.json"] {
            let error = refusal(&submitted(with_mesh(bad)), &served);
            assert!(error.starts_with(&format!("file = \"{bad}\": ")), "{error}");
        }
        let built_in = ServedScene { folder: None, ..served };
        let error = refusal(&submitted(with_mesh("tools/rod.obj")), &built_in);
        assert!(error.contains("the built-in scene is served"), "{error}");
    }

    #[test]
    fn a_bad_scene_is_refused_with_line_and_key() {
        let folder = tempfile::tempdir().unwrap();
        let served = served(folder.path());
        let refused = |text: &str| refusal(&submitted(text.to_owned()), &served);
        let stiff = BUILT_IN_SCENE.replacen("young_modulus_pa = 3e4", "young_modulus_pa = -1.0", 1);
        let error = refused(&stiff);
        assert!(error.starts_with("mine.toml:") && error.contains("young_modulus_pa: -1 is outside"), "{error}");
        assert!(refused("[objects").contains("not valid TOML"));
        assert!(refused("").contains("mine.toml"));
    }
}
