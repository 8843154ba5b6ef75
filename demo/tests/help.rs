//! What the programs say of themselves: every command has examples, and each of them is a command
//! line that the program takes; completions for shells can be written.
#![allow(clippy::unwrap_used)] // tests may panic

use clap::{Command, CommandFactory};
use fht_demo::HandoffArgs;
use std::process::Command as Process;

fn programs() -> [Command; 6] {
    [
        mapper::program::command(),
        client_robot::program::command(),
        map_server::command(),
        HandoffArgs::command(),
        fht_ros_sim::program::command(),
        foxglove_bridge::command(),
    ]
}

/// All commands of a program, with the words that lead to them.
fn commands(command: &Command, words: &str) -> Vec<(String, Command)> {
    let mut found = vec![(words.to_owned(), command.clone())];
    for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help") {
        found.extend(commands(inner, &format!("{words} {}", inner.get_name())));
    }
    found
}

/// The words of a line as a shell would split it: up to a comment, which stands after a `#` or two
/// spaces, and up to a redirection.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut is_quoted) = (Vec::new(), String::new(), false);
    let mut letters = line.trim().chars().peekable();
    while let Some(letter) = letters.next() {
        match letter {
            '\'' => is_quoted = !is_quoted,
            ' ' if !is_quoted => {
                words.extend(Some(std::mem::take(&mut word)).filter(|word| !word.is_empty()));
                if matches!(letters.peek(), Some(' ' | '#' | '>' | '&')) {
                    break;
                }
            }
            letter => word.push(letter),
        }
    }
    words.extend(Some(word).filter(|word| !word.is_empty()));
    words
}

#[test]
fn every_command_has_examples_that_its_program_takes() {
    let programs = programs();
    let (mut without, mut wrong, mut count) = (Vec::new(), Vec::new(), 0);
    for program in &programs {
        for (name, command) in commands(program, program.get_name()) {
            let help = command.term_width(0).render_long_help().to_string();
            let Some((_, examples)) = help.split_once("\nExamples:\n") else {
                without.push(name);
                continue;
            };
            let of_programs = examples.lines().take_while(|line| line.is_empty() || line.starts_with(' '));
            let lines = of_programs.map(words).filter(|words| !words.is_empty());
            let mut has_own = false;
            for line in lines {
                let Some(called) = programs.iter().find(|program| program.get_name() == line[0]) else { continue };
                count += 1;
                has_own |= line.join(" ").starts_with(&name);
                if let Err(error) = called.clone().try_get_matches_from(&line) {
                    wrong.push(format!("{name}: {}: {error}", line.join(" ")));
                }
            }
            // Flags may stand before the command.
            let is_top = !name.contains(' ');
            assert!(has_own || is_top || name.ends_with("completions"), "{name} has no example of its own");
        }
    }
    assert!(without.is_empty(), "without examples: {without:?}");
    assert!(wrong.is_empty(), "examples that are wrong:\n{}", wrong.join("\n"));
    assert!(count > 60, "{count} examples");
}

#[test]
fn no_help_has_lines_that_a_terminal_of_100_columns_breaks() {
    for program in programs() {
        for (name, command) in commands(&program, program.get_name()) {
            for help in [command.get_after_help(), command.get_after_long_help()].into_iter().flatten() {
                for line in help.to_string().lines() {
                    assert!(line.chars().count() <= 100, "{name}: {line}");
                }
            }
        }
    }
}

#[test]
fn a_flags_value_is_called_what_it_is() {
    for program in programs() {
        for (name, command) in commands(&program, program.get_name()) {
            let flags = command.get_arguments().filter(|flag| flag.get_action().takes_values() && !flag.is_hide_set());
            for flag in flags {
                // Seconds, metres, a file: the name of the flag over again says nothing.
                let Some(long) = flag.get_long() else { continue };
                let values = flag.get_value_names().unwrap_or_default();
                let again = long.replace('-', "_").to_uppercase();
                assert!(!values.is_empty() && values[0].as_str() != again, "{name} --{long} {values:?}");
            }
        }
    }
}

#[test]
fn coordinates_and_angles_may_be_negative() {
    for line in [
        "client-robot path --from -1,2 --to -3,-1",
        "client-robot go --to -3,1 --start -1,2,-90 --map-origin -1,-2,-1.57rad",
        "client-robot relocalize --start -1,2,0 --footprint -1,-1_1,-1_0,1",
        "mapper explore --start -1,2,0 --map-origin -1,2",
        "map-server place m dock -1,2,-90",
        "map-server zone m wet '-1,-1 1,-1 1,1'",
        "map-server send m tug -1,2,-90",
    ] {
        let words = words(line);
        let program = programs().into_iter().find(|program| program.get_name() == words[0]).unwrap();
        let taken = program.clone().try_get_matches_from(&words);
        assert!(taken.is_ok(), "{line}: {}", taken.unwrap_err());
    }
}

#[test]
fn shells_get_completions() {
    for role in [None, Some("mapper"), Some("client-robot"), Some("map-server")] {
        for shell in ["bash", "zsh", "fish"] {
            let mut command = Process::new(env!("CARGO_BIN_EXE_handoff"));
            if let Some(role) = role {
                command.args(["role", role, "--"]);
            }
            let output = command.args(["completions", shell]).output().unwrap();
            let text = String::from_utf8(output.stdout).unwrap();
            let name = role.unwrap_or("handoff");
            assert!(output.status.success() && text.contains(name) && text.contains("completions"), "{name} {shell}");
        }
    }
}

#[test]
fn readers_may_stop_reading() {
    for line in [&["completions", "bash"][..], &["role", "map-server", "--", "completions", "zsh"]] {
        let mut command = Process::new(env!("CARGO_BIN_EXE_handoff"));
        command.args(line).stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped());
        let mut child = command.spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let complaint = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && complaint.is_empty(), "{line:?}: {complaint}");
    }
}

#[test]
fn old_spellings_are_taken() {
    for line in [
        "client-robot go --to 1,2 --no-camera --max-time-s 5",
        "map-server zone m z '0,0 1,0 1,1' --speed 0.3",
        "handoff --json report.json",
    ] {
        let words = words(line);
        let program = programs().into_iter().find(|program| program.get_name() == words[0]).unwrap();
        assert!(program.clone().try_get_matches_from(&words).is_ok(), "{line}");
        let help: Vec<String> =
            commands(&program, "").into_iter().map(|(_, mut it)| it.render_long_help().to_string()).collect();
        assert!(!help.concat().contains("no-camera "), "what is old is not shown");
    }
}

#[test]
fn a_second_name_that_messages_take_for_the_first_is_shown() {
    // 'handoff --json' without a file is told of --report.
    let help = HandoffArgs::command().render_long_help().to_string();
    assert!(help.contains("[alias: --json]"), "{help}");
}
