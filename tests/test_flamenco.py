"""The job type for Flamenco against a stub of the manager's documented interface; Node.js runs it."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parent.parent / "examples" / "flamenco" / "skinwright_wardrobe.js"
STUB = """
const author = {
    Task: (name, type) => ({ name, type, commands: [], addCommand(command) { this.commands.push(command); } }),
    Command: (name, parameters) => ({ name, parameters }),
};
const job = { settings: SETTINGS, tasks: [], addTask(task) { this.tasks.push(task); } };
"""


@pytest.mark.skipif(shutil.which("node") is None, reason="needs Node.js")
@pytest.mark.parametrize("save_blend", [False, True])
def test_one_task_per_shard(save_blend):
    settings = {"manifest": "/w.json", "output": "/out", "shards": 3, "save_blend": save_blend, "blender": "{blender}"}
    program = STUB.replace("SETTINGS", json.dumps(settings)) + SCRIPT.read_text(encoding="utf-8")
    program += "compileJob(job); console.log(JSON.stringify([JOB_TYPE, job.tasks]));"
    done = subprocess.run(["node", "-e", program], capture_output=True, text=True, timeout=60, check=True)
    job_type, tasks = json.loads(done.stdout)
    assert {setting["key"] for setting in job_type["settings"]} == set(settings)
    assert [task["name"] for task in tasks] == ["shard-0", "shard-1", "shard-2"]
    for index, task in enumerate(tasks):
        (command,) = task["commands"]
        assert command["name"] == "exec" and command["parameters"]["exe"] == "{blender}"
        arguments = command["parameters"]["args"]
        assert arguments[:3] == ["--command", "skinwright", "wardrobe"]
        assert arguments[arguments.index("--shard") + 1] == f"{index}/3"
        assert ("--save-blend" in arguments) == save_blend
