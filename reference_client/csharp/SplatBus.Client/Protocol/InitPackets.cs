// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;

namespace SplatBus
{
    /// <summary>Takes an init packet whose images lie in memory of the host out of a payload, and checks all of it.</summary>
    public static class InitPackets
    {
        const int ColorPixelBytes = 16, DepthPixelBytes = 4, Alignment = 16;

        /// <summary>Whether a message of the IPC channel is meant as one [INI-11].</summary>
        public static bool IsOne(JsonValue message)
        {
            JsonValue member;
            return message.TryMember("meta", out member) && !message.TryMember("type", out member);
        }

        /// <summary>The packet; null from a server of 1.0, whose images are in memory of a GPU.</summary>
        /// <exception cref="ProtocolException">It breaks a rule, or is of other memory: do not open that [INI-9, MEM-11].</exception>
        public static InitPacket Read(JsonValue message)
        {
            var root = new Part(message, "");
            Part version, handle;
            if (!root.Has("version", out version)) return null;
            if (!IsOwnOrLater(version.Text("MEM-1"))) throw version.Broken("is no 1.x from 1.1 on", "MEM-1");
            Meta meta = ReadMeta(root.Member("meta", "INI-1"));
            long generation = root.Member("generation", "MEM-1").Integer(1, Limits.MaxSafeInteger, "MEM-1");
            HostShmMemory memory = ReadMemory(root.Member("memory", "MEM-2"));
            foreach (string name in new[] { "mem_color", "mem_depth", "evt_done" })
                if (root.Has(name, out handle)) throw handle.Broken("is there with memory of the host", "MEM-3");
            Ring ring = ReadRing(root.Member("ring", "MEM-8"), meta.W * meta.H);
            CheckSlots(ring, meta.W * meta.H, memory.Bytes);
            Semantics semantics = ReadSemantics(root.Member("semantics", "MEM-12"));
            return new InitPacket { Version = "1.1", Generation = generation, Meta = meta, Memory = memory, Ring = ring, Semantics = semantics };
        }

        /// <summary>"1." and a decimal integer without leading zeros; a later one is as good as 1.1 [MEM-18].</summary>
        static bool IsOwnOrLater(string version)
        {
            if (version.Length < 3 || version[0] != '1' || version[1] != '.' || version[2] == '0') return false;
            for (int i = 2; i < version.Length; i++) if (version[i] < '0' || version[i] > '9') return false;
            return true;
        }

        static Meta ReadMeta(Part part)
        {
            var meta = new Meta
            {
                W = part.Member("w", "INI-1").Integer(1, Limits.MaxImageSize, "INI-2"),
                H = part.Member("h", "INI-1").Integer(1, Limits.MaxImageSize, "INI-2"),
            };
            part.Member("fmtColor", "INI-1").OneOf("INI-3", meta.FmtColor);
            part.Member("fmtDepth", "INI-1").OneOf("INI-3", meta.FmtDepth);
            meta.PitchColor = part.Member("pitchColor", "INI-1").Integer(ColorPixelBytes * meta.W, ColorPixelBytes * meta.W, "INI-4");
            meta.PitchDepth = part.Member("pitchDepth", "INI-1").Integer(DepthPixelBytes * meta.W, DepthPixelBytes * meta.W, "INI-4");
            Part each;
            if (part.Has("offsetColor", out each)) meta.OffsetColor = each.Multiple(ColorPixelBytes, 0, "INI-5");
            if (part.Has("offsetDepth", out each)) meta.OffsetDepth = each.Multiple(DepthPixelBytes, 0, "INI-5");
            if (part.Has("device", out each)) meta.Device = each.Integer(0, Limits.MaxSafeInteger, "INI-6");
            return meta;
        }

        static HostShmMemory ReadMemory(Part part)
        {
            part.Member("kind", "MEM-2").OneOf("MEM-2", MemoryKind.HostShm);
            Part named = part.Member("name", "MEM-2");
            string name = named.Text("MEM-7");
            bool good = name.Length > 0 && name.Length <= Limits.MaxShmNameChars && name[0] != '.';
            foreach (char each in name) good &= each < 0x80 && (char.IsLetterOrDigit(each) || each == '.' || each == '_' || each == '-');
            if (!good) throw named.Broken("is no name of 1 to 30 of A-Z a-z 0-9 . _ -", "MEM-7");
            return new HostShmMemory { Name = name, Bytes = part.Member("bytes", "MEM-2").Integer(1, Limits.MaxSafeInteger, "MEM-2") };
        }

        static Ring ReadRing(Part part, long pixels)
        {
            return new Ring
            {
                Slots = part.Member("slots", "MEM-8").Integer(1, Limits.MaxSlots, "MEM-8"),
                ColorOffset = part.Member("colorOffset", "MEM-8").Multiple(Alignment, 0, "MEM-8"),
                ColorStride = part.Member("colorStride", "MEM-8").Multiple(Alignment, ColorPixelBytes * pixels, "MEM-8"),
                DepthOffset = part.Member("depthOffset", "MEM-8").Multiple(Alignment, 0, "MEM-8"),
                DepthStride = part.Member("depthStride", "MEM-8").Multiple(Alignment, DepthPixelBytes * pixels, "MEM-8"),
            };
        }

        /// <summary>Every slot lies in the memory, and none in another; no sum of this overflows 64 bits [MEM-9, MEM-10, INI-10].</summary>
        static void CheckSlots(Ring ring, long pixels, long bytes)
        {
            var extents = new List<KeyValuePair<long, long>>();
            for (long slot = 0; slot < ring.Slots; slot++)
            {
                Place(extents, ring.ColorOffset + slot * ring.ColorStride, ColorPixelBytes * pixels, bytes, "/ring/colorOffset");
                Place(extents, ring.DepthOffset + slot * ring.DepthStride, DepthPixelBytes * pixels, bytes, "/ring/depthOffset");
            }
            extents.Sort((one, other) => one.Key.CompareTo(other.Key));
            for (int i = 1; i < extents.Count; i++)
                if (extents[i - 1].Value > extents[i].Key) throw new ProtocolException("has two slots that overlap at byte " + extents[i].Key + " [MEM-9]", "/ring");
        }

        static void Place(List<KeyValuePair<long, long>> extents, long start, long length, long bytes, string pointer)
        {
            if (start > bytes - length) throw new ProtocolException("has a slot of " + length + " bytes begin at " + start + " of " + bytes + " [MEM-10]", pointer);
            extents.Add(new KeyValuePair<long, long>(start, start + length));
        }

        static Semantics ReadSemantics(Part part)
        {
            var semantics = new Semantics();
            part.Member("rows", "MEM-12").OneOf("MEM-12", semantics.Rows);
            semantics.Alpha = part.Member("alpha", "MEM-12").OneOf("MEM-12", SemanticsAlpha.Straight, SemanticsAlpha.Premultiplied);
            semantics.ColorSpace = part.Member("colorSpace", "MEM-12").OneOf("MEM-12", SemanticsColorSpace.Srgb, SemanticsColorSpace.Linear);
            Part depth = part.Member("depth", "MEM-12"), empty = depth.Member("empty", "MEM-12"), unit = part.Member("unitMetres", "MEM-12");
            semantics.Depth = new DepthSemantics
            {
                Kind = depth.Member("kind", "MEM-12").OneOf("MEM-12", DepthSemanticsKind.PlanarZ, DepthSemanticsKind.RayDistance),
                Estimator = depth.Member("estimator", "MEM-12").OneOf("MEM-12", DepthSemanticsEstimator.Harmonic, DepthSemanticsEstimator.Expected, DepthSemanticsEstimator.Median),
                Empty = empty.Value.Is("inf") ? double.PositiveInfinity : empty.Number("MEM-12"),
            };
            if (!empty.Value.Is("inf") && float.IsInfinity((float)semantics.Depth.Empty)) throw empty.Broken("is beyond single precision", "MEM-12");
            if (unit.Value.Kind != JsonKind.Null) semantics.UnitMetres = unit.Number("MEM-12");
            if (semantics.UnitMetres <= 0) throw unit.Broken("is not positive", "MEM-12");
            semantics.Origin = part.Member("origin", "MEM-12").Vector(3, "MEM-12");
            return semantics;
        }
    }
}
