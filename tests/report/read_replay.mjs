// Reads an MCAP file with the MCAP project's own TypeScript reader and protobufjs, checks every
// message against the schemas that Foxglove publishes, and prints what it found as JSON.
// Usage: VALIDATE_NODE_MODULES=<folder with the packages> node read_replay.mjs FILE
import { open } from "node:fs/promises";
import { createRequire } from "node:module";
import { join } from "node:path";

const require = createRequire(join(process.env.VALIDATE_NODE_MODULES, "from-here.js"));
const { McapIndexedReader } = require("@mcap/core");
const { FileHandleReadable } = require("@mcap/nodejs");
const { loadDecompressHandlers, protobufFromBinaryDescriptor } = require("@mcap/support");
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

// Types by schema; times as Foxglove's definitions name them, bytes as base64.
const types = new Map();
function decoded(schema, data) {
  if (!types.has(schema.id)) {
    types.set(schema.id, protobufFromBinaryDescriptor(schema.data).lookupType(schema.name));
  }
  const type = types.get(schema.id);
  return timed(type.toObject(type.decode(data), { defaults: true, longs: Number, bytes: String }));
}
function timed(value) {
  if (Array.isArray(value)) return value.map(timed);
  if (value === null || typeof value !== "object") return value;
  const { seconds, nanos, ...others } = value;
  if (seconds !== undefined && nanos !== undefined) return { sec: seconds, nsec: nanos };
  return Object.fromEntries(Object.entries(others).map(([k, v]) => [k, timed(v)]));
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
  const message = decoded(schema, data);
  const wrong = [];
  if (byTitle.has(schema.name)) {
    wrong.push(...faults(byTitle.get(schema.name), message));
    found.published[schema.name] = true;
    found.checked += 1;
  }
  found.wrong.push(...wrong.slice(0, 3).map((w) => `${topic}: ${w}`));
  found.ordered &&= before <= logTime && logTime === publishTime;
  before = logTime;
  const entry = (found.topics[topic] ??= {
    schema: schema.name, encodings: [schema.encoding, messageEncoding], count: 0,
    first: String(logTime),
  });
  entry.example ??= byTitle.has(schema.name) ? undefined : message;
  entry.count += 1;
  entry.last = String(logTime);
}
await file.close();
console.log(JSON.stringify(found));
