// A job type for Flamenco 3, Blender's farm manager: one task per shard of a wardrobe.
// Copy it into the `scripts` folder beside the Flamenco Manager and restart the manager; it was tried against a stub of the
// documented interface (tests/test_flamenco.py), not on a farm. https://flamenco.blender.org/usage/job-types/

const JOB_TYPE = {
    label: "Skinwright Wardrobe",
    description: "Transfer skin weights from bodies to garments; what has a result already is kept.",
    settings: [
        { key: "manifest", type: "string", required: true, description: "Manifest, as the workers see it" },
        { key: "output", type: "string", required: true, subtype: "dir_path", description: "Folder for results" },
        { key: "shards", type: "int32", default: 8, propargs: { min: 1, max: 4096 }, description: "Number of tasks" },
        { key: "save_blend", type: "bool", default: false, description: "Save each dressed scene too" },
        { key: "blender", type: "string", default: "{blender}", visible: "web", description: "Blender's executable" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    for (let shard = 0; shard < settings.shards; shard++) {
        const task = author.Task(`shard-${shard}`, "misc");
        task.addCommand(author.Command("exec", {
            exe: settings.blender,
            args: wardrobe(settings, `${shard}/${settings.shards}`),
        }));
        job.addTask(task);
    }
}

// The extension must be enabled in the workers' Blender.
function wardrobe(settings, shard) {
    const args = ["--command", "skinwright", "wardrobe", settings.manifest, "--out", settings.output, "--shard", shard];
    return settings.save_blend ? args.concat("--save-blend") : args;
}
