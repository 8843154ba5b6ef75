"""What a recording shows, as JSON: its channels, and what a viewer would draw in the end."""

import json
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

ALL = 1  # SceneEntityDeletion.Type
FREE = 160  # how opaque a cell is that is free


def main() -> None:
    scenes, channels, counts, sizes = {}, {}, {}, {}
    frames, last = {}, {}
    with open(sys.argv[1], "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message, decoded in reader.iter_decoded_messages():
            topic = channel.topic
            channels[topic] = schema.name
            counts[topic] = counts.get(topic, 0) + 1
            sizes[topic] = sizes.get(topic, 0) + len(message.data)
            if schema.name == "foxglove.SceneUpdate":
                draw(scenes.setdefault(topic, {}), decoded)
            elif schema.name == "foxglove.FrameTransforms":
                for it in decoded.transforms:
                    frames[it.child_frame_id] = [it.translation.x, it.translation.y]
            else:
                last[topic] = decoded
    grid = last.get("/map/grid")
    print(json.dumps({
        "channels": channels,
        "counts": counts,
        "bytes": sizes,
        "scenes": {topic: sorted(scene) for topic, scene in scenes.items()},
        "frames": frames,
        "poses": {topic: [[it.position.x, it.position.y] for it in last[topic].poses]
                  for topic in ("/robots/poses", "/path") if topic in last},
        "grid": grid and {"columns": grid.column_count, "free": grid.data[3::4].count(FREE), "bytes": len(grid.data)},
    }))


def draw(scene: dict, update) -> None:
    for deletion in update.deletions:
        if deletion.type == ALL:
            scene.clear()
        else:
            scene.pop(deletion.id, None)
    for entity in update.entities:
        assert entity.frame_id == "map" and entity.id, entity
        scene[entity.id] = entity


main()
