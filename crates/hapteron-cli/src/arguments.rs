//! What can be written on the command line.

use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Six-degree-of-freedom haptic rendering: hold a rigid object and feel it touch a scene.
#[derive(Debug, Parser)]
#[command(name = "hapteron", version, max_term_width = 100)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Show it working: the upper jaw in a simulated hand chews on the lower one, and a report
    #[command(after_help = "Example:\n  hapteron demo --out my-demo\n")]
    Demo(Demo),
    /// Run a scene and write run.csv, scene.toml and report.html
    #[command(after_help = RUN_EXAMPLES)]
    Run(Run),
    /// The paper's experiments in virtual time: paper, measured, holds
    #[command(after_help = "Examples:\n  hapteron reproduce\n  hapteron reproduce fig2 fig6 --out figures\n")]
    Reproduce(Reproduce),
    /// Contacts between two meshes at given poses of the first
    #[command(after_help = QUERY_EXAMPLES)]
    Query(Query),
    /// Check and describe a mesh
    #[command(
        after_help = "Examples:\n  hapteron mesh part.stl\n  hapteron mesh part.stl --scale 0.001 --build --out levels\n"
    )]
    Mesh(Mesh),
    /// Two runs side by side: a table and a report
    #[command(after_help = "Example:\n  hapteron compare runs/a runs/b\n")]
    Compare(Compare),
    /// This machine's figures: step and query times, and how late ticks come
    #[command(
        after_help = "Examples:\n  hapteron bench\n  hapteron bench --json --seconds 30 > bench.json\n  hapteron bench --soak 600\n  hapteron bench --window\n  xvfb-run -s '-screen 0 1280x800x24' hapteron bench --window\n"
    )]
    Bench(Bench),
    /// Supported and attached devices, and what is missing for the others
    #[command(after_help = "Examples:\n  hapteron devices\n  hapteron devices --json\n")]
    Devices(Devices),
    /// Where in the plane of two scene keys a simulated hand can hold the object: a map
    #[command(after_help = STABILITY_EXAMPLES)]
    Stability(Stability),
    /// Write the built-in meshes and scenes into a folder, to start one's own from
    #[command(
        after_help = "Example:\n  hapteron models my-models\n  hapteron run my-models/spoon_in_cup.toml --virtual-time\n"
    )]
    Models(Models),
    /// See and feel a scene in a window: 3D view, plots, sliders; pointer and keys stand in for a haptic device
    #[command(after_help = LIVE_EXAMPLES)]
    Live(Live),
}

const LIVE_EXAMPLES: &str = "Examples:
  hapteron live                      the start page
  hapteron live --scene jaws         a built-in scene: jaws, spoon_in_cup, spoon_in_free_space
  hapteron live my-scene.toml
  hapteron live --scene jaws --screenshot jaws.png --after 5
";

const RUN_EXAMPLES: &str = "Examples:
  hapteron run scene.toml
  hapteron run scene.toml --virtual-time --replay hand.csv --out result
  hapteron run result/scene.toml --replay result/device.csv --set contact.stiffness=2000 --out other
  hapteron run scene.toml --virtual-time --set coupling.linear_stiffness=500 --set integrator.method=runge-kutta-4
";

const STABILITY_EXAMPLES: &str = "Examples:
  hapteron stability scene.toml --x body.mass=0.001:0.1:7 --y coupling.linear_stiffness=100:5000:8
  hapteron stability scene.toml --x hand.grip=released,light,medium,firm --y contact.stiffness=2000:10000:5 --set device.delay=2
";

const QUERY_EXAMPLES: &str = "Examples:
  hapteron query body.obj obstacle.obj --poses poses.csv --tolerance 0.001
  hapteron query body.stl obstacle.stl --poses poses.csv --tolerance 0.0002 --contacts contacts.csv --rate
  hapteron query body.stl obstacle.stl --poses poses.csv --tolerance 0.0002 --error-threshold 0.025 --rate
";

/// `hapteron demo`
#[derive(Args, Debug)]
pub struct Demo {
    /// Folder for the results [default: runs/demo, numbered when it exists]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Seconds [default: 10]
    #[arg(long, value_name = "S", value_parser = duration)]
    pub duration: Option<f64>,
    /// Run on the deterministic schedule, as fast as the machine can
    #[arg(long)]
    pub virtual_time: bool,
    /// What a fault that takes the force away leads to [default: wait at a terminal, else end]
    #[arg(long, value_name = "WHAT")]
    pub on_fault: Option<OnFault>,
}

/// What a fault that takes the force away leads to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum OnFault {
    /// The end, with exit code 1
    End,
    /// No force until Enter is pressed
    Wait,
}

/// `hapteron run`
#[derive(Args, Debug)]
pub struct Run {
    /// The scene (TOML)
    #[arg(value_name = "SCENE.toml")]
    pub scene: PathBuf,
    /// Run on the deterministic schedule, as fast as the machine can, instead of in real time
    #[arg(long)]
    pub virtual_time: bool,
    /// End after so many seconds [default: with the scene's motion]
    #[arg(long, value_name = "S", value_parser = duration)]
    pub duration: Option<f64>,
    /// Let the handle follow this motion exactly (t,px,py,pz,qw,qx,qy,qz) instead of the scene's hand; or make a session again from its device.csv
    /// (in virtual time; the same bits, or what they would have been under --set)
    #[arg(long, value_name = "T.csv")]
    pub replay: Option<PathBuf>,
    /// Override a key of the scene, as in contact.stiffness=2000; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
    /// What a fault that takes the force away leads to [default: wait at a terminal, else end]
    #[arg(long, value_name = "WHAT")]
    pub on_fault: Option<OnFault>,
    /// Folder for the results [default: runs/NAME, numbered when it exists]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `hapteron stability`
#[derive(Args, Debug)]
pub struct Stability {
    /// The scene (TOML); without a hand it is held with a medium grip
    #[arg(value_name = "SCENE.toml")]
    pub scene: PathBuf,
    /// The key to the right with its range, as in body.mass=0.001:0.1:7, or values, as in hand.grip=light,firm
    #[arg(long, value_name = "KEY=LO:HI:N")]
    pub x: String,
    /// The key upward, written like --x
    #[arg(long, value_name = "KEY=LO:HI:N")]
    pub y: String,
    /// Override a key of the scene for all cells; may be repeated
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub overrides: Vec<String>,
    /// Folder for the results [default: runs/stability-NAME, numbered when it exists]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `hapteron query`
#[derive(Args, Debug)]
pub struct Query {
    /// The mesh that moves (OBJ, STL, PLY or OFF)
    #[arg(value_name = "A")]
    pub body: PathBuf,
    /// The mesh that stays
    #[arg(value_name = "B")]
    pub obstacle: PathBuf,
    /// Poses of A's mesh frame in B's (CSV: t,px,py,pz,qw,qx,qy,qz; metres, unit quaternion)
    #[arg(long, value_name = "P.csv")]
    pub poses: PathBuf,
    /// Surfaces closer than this are in contact, metres
    #[arg(long, value_name = "D")]
    pub tolerance: f64,
    /// Write every contact into this file (CSV; world frame)
    #[arg(long, value_name = "C.csv")]
    pub contacts: Option<PathBuf>,
    /// Metres per unit of both meshes
    #[arg(long, default_value_t = 1.0, value_name = "S")]
    pub scale: f64,
    /// Contacts may be as coarse as this share of A's radius, such as 0.025; each then has a weight, the number of vertices
    /// that it stands for. 0 is exact
    #[arg(long, default_value_t = 0.0, value_name = "S")]
    pub error_threshold: f64,
    /// Tell on stderr how long the queries took
    #[arg(long)]
    pub rate: bool,
}

/// `hapteron mesh`
#[derive(Args, Debug)]
pub struct Mesh {
    /// The mesh (OBJ, STL, PLY or OFF), or builtin:NAME
    #[arg(value_name = "FILE")]
    pub file: String,
    /// Metres per unit of the mesh
    #[arg(long, default_value_t = 1.0, value_name = "S")]
    pub scale: f64,
    /// Make and cache the contact levels of detail, print them, and draw them in a report
    #[arg(long)]
    pub build: bool,
    /// With --build: folder for the report [default: runs/mesh, numbered when it exists]
    #[arg(long, value_name = "DIR", requires = "build")]
    pub out: Option<PathBuf>,
    /// With --build: folder of the cache [default: hapteron in the user's cache folder]
    #[arg(long, value_name = "DIR", requires = "build")]
    pub cache: Option<PathBuf>,
}

/// `hapteron compare`
#[derive(Args, Debug)]
pub struct Compare {
    /// A run.csv, or the folder with it
    #[arg(value_name = "A")]
    pub first: PathBuf,
    /// The run to be compared with the first
    #[arg(value_name = "B")]
    pub second: PathBuf,
    /// Folder for the report [default: runs/compare, numbered when it exists]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// `hapteron bench`
#[derive(Args, Debug)]
pub struct Bench {
    /// As JSON
    #[arg(long)]
    pub json: bool,
    /// How long each of the two loops runs; with --window, how long each way of treating the window is watched
    #[arg(long, default_value_t = 10.0, value_name = "N", value_parser = duration)]
    pub seconds: f64,
    /// Instead: a session for so many seconds, and whether it leaks memory or drifts
    #[arg(long, value_name = "SECONDS", value_parser = duration)]
    pub soak: Option<f64>,
    /// Instead: whether ticks come later while the window of `hapteron live` is open, moved, resized or frozen, and when it opens and closes;
    /// it is opened on this display several times
    #[arg(long, conflicts_with = "soak")]
    pub window: bool,
}

/// `hapteron devices`
#[derive(Args, Debug)]
pub struct Devices {
    /// The same as JSON (SI units; null is a limit that is not known)
    #[arg(long)]
    pub json: bool,
}

/// `hapteron models`
#[derive(Args, Debug)]
pub struct Models {
    /// The folder, made when it does not exist
    #[arg(value_name = "DIR")]
    pub folder: PathBuf,
}

/// `hapteron reproduce`
#[derive(Args, Debug)]
pub struct Reproduce {
    /// Which figures of the paper [default: all]
    #[arg(value_enum, value_name = "FIGURE")]
    pub figures: Vec<Figure>,
    /// Folder for the results [default: runs/reproduce, numbered when it exists]
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

/// An experiment of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Figure {
    /// The spoon in free space: integrators and masses
    Fig2,
    /// The spoon in the cup: contact
    Fig4,
    /// The jaws: the linearized contact model and slow contact threads
    Fig6,
}

/// `hapteron live`
#[derive(Args, Debug)]
#[cfg_attr(not(feature = "window"), allow(dead_code))]
pub struct Live {
    /// The scene (TOML) [default: the start page]
    #[arg(value_name = "SCENE.toml")]
    pub file: Option<PathBuf>,
    /// A built-in scene instead of a file
    #[arg(long, value_name = "NAME", conflicts_with = "file", value_parser = hapteron::scenes::NAMES)]
    pub scene: Option<String>,
    /// Bright surroundings [default: as the system]
    #[arg(long, conflicts_with = "dark")]
    pub light: bool,
    /// Dark surroundings [default: as the system]
    #[arg(long)]
    pub dark: bool,
    /// Width and height of the window, points [default: 1280x800]
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub size: Option<[f32; 2]>,
    /// Save a picture of the window (PNG) and close
    #[arg(long, value_name = "FILE")]
    pub screenshot: Option<PathBuf>,
    /// When to take the picture, seconds [default: 3]; without --screenshot: when to close
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub after: Option<f64>,
    /// Write where buttons and values are (name,left,top,right,bottom; pixels), for scripts that drive the window
    #[arg(long, value_name = "FILE")]
    pub widgets: Option<PathBuf>,
}

/// A time that a person can wait for.
fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if (0.0..=1e6).contains(&seconds) => Ok(seconds),
        _ => Err("must be a number of seconds, not negative".to_owned()),
    }
}

/// How long something lasts.
fn duration(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("must be a positive number of seconds".to_owned()),
    }
}

/// Width and height, as in 1280x800.
fn size(text: &str) -> Result<[f32; 2], String> {
    let parse = |word: &str| word.parse::<f32>().ok().filter(|n| (100.0..=10_000.0).contains(n));
    match text.split_once('x').map(|(w, h)| (parse(w), parse(h))) {
        Some((Some(width), Some(height))) => Ok([width, height]),
        _ => Err("must be width and height as in 1280x800, each from 100 to 10000".to_owned()),
    }
}
