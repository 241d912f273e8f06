//! Scene of a job: text and the files that it names (meshes, recorded motions), checked before the job is accepted.

use std::fs;
use std::path::{Component, Path, PathBuf};

use plica_protocol::jobs::JobSubmitRequest;
use plica_scene::Config;
use plica_scene::scene::named_files;
use plica_training::{JobPaths, write_atomically};

use crate::error::JobError;

/// Largest file that is copied into a job's folder.
const MAX_FILE_BYTES: u64 = 64 << 20;

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

/// A checked scene with its files.
#[derive(Debug)]
pub(crate) struct JobScene {
    pub(crate) name: String,
    text: String,
    /// Path below the scene's folder, and content.
    files: Vec<(PathBuf, Vec<u8>)>,
}

impl JobScene {
    /// Scene of a request, or the served one if the request has none.
    pub(crate) fn new(request: &JobSubmitRequest, served: &ServedScene) -> Result<Self, JobError> {
        let folder = served.folder.as_deref();
        let (name, text) = match &request.scene {
            Some(text) => (request.scene_name.as_deref().unwrap_or("scene"), text),
            None => (served.name.as_str(), &served.text),
        };
        let files = read_files(text, folder, request.scene.is_none())?;
        check(name, text, folder)?;
        Ok(Self { name: name.to_owned(), text: text.clone(), files })
    }

    /// Writes `scene.toml` and the files that it names into a job's folder.
    pub(crate) fn write(&self, paths: &JobPaths) -> std::io::Result<()> {
        write_atomically(&paths.scene(), self.text.as_bytes())?;
        for (path, bytes) in &self.files {
            let path = paths.root().join(path);
            fs::create_dir_all(path.parent().unwrap_or(paths.root()))?;
            write_atomically(&path, bytes)?;
        }
        Ok(())
    }
}

/// Checks the scene; errors name the file without the daemon's folders.
fn check(name: &str, text: &str, folder: Option<&Path>) -> Result<(), JobError> {
    let file = PathBuf::from(format!("{name}.toml"));
    match Config::parse(&folder.unwrap_or(Path::new("")).join(&file), text) {
        Ok(_) => Ok(()),
        Err(mut error) => {
            error.file = file;
            Err(JobError::Scene(error.to_string()))
        }
    }
}

/// Reads the files that a scene names, and refuses files that are large, not ordinary, or outside of `folder`. Runs before
/// anything else opens them.
///
/// The daemon's own scene may name files by absolute paths; they are not copied.
fn read_files(text: &str, folder: Option<&Path>, own: bool) -> Result<Vec<(PathBuf, Vec<u8>)>, JobError> {
    // Text that is not a scene is refused by `check`, with the line.
    let named = named_files(Path::new("scene.toml"), text).into_iter().map(|file| file.typed);
    let wanted = named.filter(|name| !(own && Path::new(name).is_absolute()));
    wanted.map(|name| read_file(&name, folder).map(|bytes| (PathBuf::from(name), bytes))).collect()
}

fn read_file(name: &str, folder: Option<&Path>) -> Result<Vec<u8>, JobError> {
    let refuse = |why: &str| Err(JobError::Scene(format!("file = \"{name}\": {why}")));
    if !is_plain(name) {
        return refuse("files of a job's scene must lie beside the served scene or below it");
    }
    let Some(folder) = folder else {
        return refuse("the built-in scene is served, which has no folder to take files from");
    };
    let path = folder.join(name);
    match fs::metadata(&path) {
        Ok(file) if !file.is_file() => refuse("it is not an ordinary file"),
        Ok(file) if file.len() > MAX_FILE_BYTES => refuse("it is larger than 64 MiB"),
        Ok(_) => fs::read(&path).or_else(|e| refuse(&format!("it cannot be read: {e}"))),
        Err(e) => refuse(&format!("it cannot be read beside the served scene: {e}")),
    }
}

/// Whether a path stays below its folder and does not collide with a job's own files.
fn is_plain(name: &str) -> bool {
    let mut parts = Path::new(name).components();
    let down = !name.is_empty() && parts.clone().all(|part| matches!(part, Component::Normal(_)));
    down && parts.next().is_some_and(|first| !JobPaths::is_reserved(first.as_os_str()))
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
        let scene = JobScene::new(&JobSubmitRequest::new("a", JobKind::Training), &served).unwrap();
        let paths = JobPaths::new(job.path().to_owned());
        scene.write(&paths).unwrap();
        assert_eq!(fs::read_to_string(job.path().join("tools/rod.obj")).unwrap(), TETRAHEDRON);
        assert_eq!(fs::read_to_string(paths.scene()).unwrap(), served.text);
        Config::from_file(&paths.scene()).unwrap();
        assert_eq!(JobScene::new(&submitted(with_mesh("tools/rod.obj")), &served).unwrap().name, "mine");
    }

    #[test]
    fn files_from_elsewhere_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let served = served(folder.path());
        fs::write(folder.path().join("examples"), "").unwrap();
        let secret = folder.path().join("tools/rod.obj");
        for bad in ["../rod.obj", "/dev/zero", secret.to_str().unwrap(), "tools", "no.obj", "examples", "job.json"] {
            let error = JobScene::new(&submitted(with_mesh(bad)), &served).unwrap_err().to_string();
            assert!(error.starts_with(&format!("file = \"{bad}\": ")), "{error}");
        }
        let built_in = ServedScene { folder: None, ..served };
        let error = JobScene::new(&submitted(with_mesh("tools/rod.obj")), &built_in).unwrap_err().to_string();
        assert!(error.contains("the built-in scene is served"), "{error}");
    }

    #[test]
    fn a_bad_scene_is_refused_with_line_and_key() {
        let folder = tempfile::tempdir().unwrap();
        let served = served(folder.path());
        let refused = |text: &str| JobScene::new(&submitted(text.to_owned()), &served).unwrap_err().to_string();
        let stiff = BUILT_IN_SCENE.replacen("young_modulus_pa = 3e4", "young_modulus_pa = -1.0", 1);
        let error = refused(&stiff);
        assert!(error.starts_with("mine.toml:") && error.contains("young_modulus_pa: -1 is outside"), "{error}");
        assert!(refused("[objects").contains("not valid TOML"));
        assert!(refused("").contains("mine.toml"));
    }
}
