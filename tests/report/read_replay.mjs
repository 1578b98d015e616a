// Reads an MCAP file with the MCAP project's own TypeScript reader, checks every message against the
// schemas that Foxglove publishes and against those in the file, and prints what it found as JSON.
// Usage: VALIDATE_NODE_MODULES=<folder with the packages> node read_replay.mjs FILE
import { open } from "node:fs/promises";
import { createRequire } from "node:module";
import { join } from "node:path";

const require = createRequire(join(process.env.VALIDATE_NODE_MODULES, "from-here.js"));
const { McapIndexedReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { loadDecompressHandlers } = require("@mcap/support");
const Ajv = require("ajv").default;
const published = require("@foxglove/schemas/jsonschema");

const ajv = new Ajv({ strict: false });
const compiled = new Map();
function faults(definition, message) {
  const key = JSON.stringify(definition);
  if (!compiled.has(key)) compiled.set(key, ajv.compile(definition));
  const validate = compiled.get(key);
  return validate(message) ? [] : validate.errors.map((e) => `${e.instancePath} ${e.message}`);
}

const byTitle = new Map(Object.values(published).map((s) => [s.title, s]));
const file = await open(process.argv[2], "r");
const reader = await McapIndexedReader.Initialize({
  readable: new FileHandleReadable(file),
  decompressHandlers: await loadDecompressHandlers(),
});

const found = { topics: {}, published: {}, metadata: {}, wrong: [], checked: 0, ordered: true };
for await (const { name, metadata } of reader.readMetadata()) {
  found.metadata[name] = Object.fromEntries(metadata);
}
let before = 0n;
for await (const { channelId, logTime, publishTime, data } of reader.readMessages()) {
  const { topic, schemaId, messageEncoding } = reader.channelsById.get(channelId);
  const schema = reader.schemasById.get(schemaId);
  const message = JSON.parse(new TextDecoder().decode(data));
  const wrong = faults(JSON.parse(new TextDecoder().decode(schema.data)), message);
  if (byTitle.has(schema.name)) {
    wrong.push(...faults(byTitle.get(schema.name), message));
    found.published[schema.name] = byTitle.get(schema.name);
    found.checked += 1;
  }
  found.wrong.push(...wrong.slice(0, 3).map((w) => `${topic}: ${w}`));
  found.ordered &&= before <= logTime && logTime === publishTime;
  before = logTime;
  const entry = (found.topics[topic] ??= {
    schema: schema.name, encodings: [schema.encoding, messageEncoding], count: 0,
    first: String(logTime),
  });
  entry.count += 1;
  entry.last = String(logTime);
}
await file.close();
console.log(JSON.stringify(found));
