// SPDX-License-Identifier: MIT
using System.Collections.Generic;

namespace SplatBus
{
    /// <summary>Takes replies and telemetry out of payloads; what breaks a rule is a ProtocolException.</summary>
    static class Replies
    {
        internal static ViewportSize Size(JsonValue message)
        {
            var sides = new Part(message, "").Member("viewport_size", "REQ-3").Items(2, 2, "REQ-3");
            return new ViewportSize
            {
                ViewportSizeValue = new[] { sides[0].Integer(0, Limits.MaxImageSize, "REQ-3"), sides[1].Integer(0, Limits.MaxImageSize, "REQ-3") },
            };
        }

        internal static Camera Camera(JsonValue message)
        {
            var root = new Part(message, "");
            var camera = new Camera { Position = new double[3], Rotation = new double[4] };
            if (!Frames.ReadPose(message, camera.Position, camera.Rotation)) throw root.Broken("has no pose", "REQ-5");
            Part lens;
            // A lens that is none does not make the pose worse.
            if (root.Has("intrinsics", out lens))
                try { camera.Intrinsics = Lenses.Read(lens); }
                catch (ProtocolException) { camera.Intrinsics = null; }
            return camera;
        }

        internal static Pong Pong(JsonValue message)
        {
            var root = new Part(message, "");
            return new Pong { T = root.Member("t", "PNG-2").Number("PNG-2"), ServerTime = root.Member("serverTime", "PNG-2").Number("PNG-2") };
        }

        internal static Scene Scene(JsonValue message)
        {
            const string rule = "SCN-2";
            var root = new Part(message, "");
            var objects = new List<SceneObject>();
            var ids = new HashSet<string>();
            foreach (Part each in root.Member("objects", rule).Items(1, Limits.MaxObjects, rule))
            {
                objects.Add(Thing(each));
                if (!ids.Add(objects[objects.Count - 1].Id)) throw each.Broken("has the id of another", rule);
            }
            if (!ids.Contains("default")) throw root.Broken("has no object \"default\"", rule);
            Part range = root.Member("timeRange", rule);
            var scene = new Scene
            {
                Objects = objects.ToArray(),
                TimeRange = range.Value.Kind == JsonKind.Null ? null : range.Vector(2, rule),
                Cameras = root.Member("cameras", rule).Integer(0, Limits.MaxSafeInteger, rule),
                Origin = root.Member("origin", rule).Vector(3, rule),
            };
            if (scene.TimeRange != null && scene.TimeRange[0] > scene.TimeRange[1]) throw range.Broken("ends before it begins", rule);
            return scene;
        }

        static SceneObject Thing(Part part)
        {
            const string rule = "SCN-2";
            Part box = part.Member("bounds", rule);
            var thing = new SceneObject
            {
                Id = part.Member("id", rule).Text(1, Limits.MaxTagChars, rule),
                Name = part.Member("name", rule).Text(0, Limits.MaxNameChars, rule),
                Gaussians = part.Member("gaussians", rule).Integer(0, Limits.MaxSafeInteger, rule),
            };
            if (box.Value.Kind == JsonKind.Null) return thing;
            thing.Bounds = new Bounds { Min = box.Member("min", rule).Vector(3, rule), Max = box.Member("max", rule).Vector(3, rule) };
            for (int i = 0; i < 3; i++) if (thing.Bounds.Min[i] > thing.Bounds.Max[i]) throw box.Broken("ends before it begins", rule);
            return thing;
        }

        /// <summary>A series of a kind that is not known is left out [TEL-6].</summary>
        internal static Telemetry Telemetry(JsonValue message)
        {
            const string rule = "TEL-2";
            var root = new Part(message, "");
            var series = new List<Series>();
            foreach (Part each in root.Member("series", rule).Items(1, Limits.MaxSeries, rule))
            {
                Series one = OneSeries(each);
                if (one == null) continue;
                one.Name = each.Member("name", rule).Text(1, Limits.MaxNameChars, rule);
                series.Add(one);
            }
            return new Telemetry
            {
                Seq = root.Member("seq", rule).Integer(0, Limits.MaxSafeInteger, rule),
                Time = root.Member("time", rule).Number(rule),
                Series = series.ToArray(),
            };
        }

        static Series OneSeries(Part part)
        {
            const string rule = "TEL-2";
            Part kind = part.Member("kind", rule), unit;
            if (kind.Value.Is(SeriesKind.Scalar))
                return new ScalarSeries
                {
                    Value = part.Member("value", rule).Number(rule),
                    Unit = part.Has("unit", out unit) ? unit.Text(0, Limits.MaxNameChars, rule) : null,
                };
            if (kind.Value.Is(SeriesKind.Text)) return new TextSeries { Value = part.Member("value", rule).Text(0, Limits.MaxTextChars, rule) };
            if (!kind.Value.Is(SeriesKind.Histogram)) return null;
            var edges = part.Member("edges", rule).Items(2, Limits.MaxEdges, rule);
            var counts = part.Member("counts", rule).Items(edges.Count - 1, edges.Count - 1, rule);
            var histogram = new HistogramSeries { Edges = new double[edges.Count], Counts = new long[counts.Count] };
            for (int i = 0; i < edges.Count; i++)
            {
                histogram.Edges[i] = edges[i].Number(rule);
                if (i > 0 && histogram.Edges[i] <= histogram.Edges[i - 1]) throw edges[i].Broken("is not greater than the one before", rule);
            }
            for (int i = 0; i < counts.Count; i++) histogram.Counts[i] = counts[i].Integer(0, Limits.MaxSafeInteger, rule);
            return histogram;
        }
    }
}
